// The surfaces that participants offer to the coupler, and that walls are made of.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

namespace acopla::geometry {

using Vec3 = Eigen::Vector3d;

/// Faces a surface may be made of. The nodes of a face stand in VTK's order: corners around the face, then the
/// middles of its edges in the same order, then its centre. Corners turn counter-clockwise seen from outside the
/// body that owns the surface; the mappings do not depend on it.
enum class FaceKind : std::uint8_t { line2 = 1, line3 = 2, triangle3 = 3, triangle6 = 4, quad4 = 5, quad9 = 6 };

/// Number of nodes of a face; 0 for a value that is not a kind.
std::size_t nodes_of(FaceKind kind);
/// Number of corners of a face (2, 3 or 4); 0 for a value that is not a kind.
std::size_t corners_of(FaceKind kind);
std::string_view name_of(FaceKind kind);

/// A surface in its reference position: points [m] and faces that name their nodes by index.
class SurfaceMesh {
 public:
  std::vector<Vec3> points;  ///< [m]; z = 0 in two dimensions

  /// Appends a face. @throws std::invalid_argument when the number of nodes is not that of the kind or a node does
  /// not exist.
  void add_face(FaceKind kind, std::span<const std::uint32_t> nodes);

  std::size_t face_count() const { return kinds_.size(); }
  FaceKind kind(std::size_t face) const { return kinds_[face]; }
  std::span<const std::uint32_t> nodes(std::size_t face) const {
    return {nodes_.data() + offsets_[face], nodes_.data() + offsets_[face + 1]};
  }
  /// All nodes of all faces, one face after another; with `kinds()` this is how a surface travels.
  const std::vector<std::uint32_t>& connectivity() const { return nodes_; }
  const std::vector<FaceKind>& kinds() const { return kinds_; }

  /// Mean of all points [m].
  Vec3 centroid() const;
  /// Diagonal of the bounding box [m].
  double extent() const;

 private:
  std::vector<FaceKind> kinds_;
  std::vector<std::size_t> offsets_{0};
  std::vector<std::uint32_t> nodes_;
};

}  // namespace acopla::geometry
