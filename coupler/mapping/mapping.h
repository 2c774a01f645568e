// Carries forces and motion between two surfaces that share a place but not their meshes.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "geometry/surface_mesh.h"
#include "io/large_memory.h"

namespace acopla::coupler {

using geometry::Vec3;

/// How a point's force finds the nodes that take it.
enum class MappingKind {
  conservative,  ///< the nearest face, by its shape functions where the point lies over it
  overlap,       ///< all faces over the faces around the point (overlap.h); the nearest face where there is none
  nearest        ///< the nearest node alone: for surfaces without faces, where nothing else is possible
};

struct MappingOptions {
  double max_distance;  ///< a point farther than this from every face has no partner [m]; > 0, may
                        ///< be infinite
  MappingKind kind = MappingKind::conservative;
  /// One value per point of `from`: 0 where the point belongs to another mapping, and neither sends nor receives here. Empty: all belong here.
  std::span<const char> own = {};
};

/// The operators between the points of `from`, which send forces and receive motion, and the nodes
/// of `to`, whose faces receive the forces and offer the motion. Both are built once, from the
/// reference positions.
///
/// Each point x of `from` has weights w_k at some nodes of `to`, of sum 1, and with them the place Px = Σ w_k x_k where its force
/// arrives. Of a conservative mapping these are the shape functions of the nearest face at the point projected on it. With H the matrix of the weights:
///
/// - `values` is H: of a conservative mapping what the face's shape functions say at Px, exact for fields that the faces
///   represent.
/// - `forces` is Hᵀ and, where x ≠ Px, the couple (x − Px) × f as nodal forces that sum to zero:
///   f_k = w_k f + (A f) × d_k, A = J⁺ [x − Px]×, J = Σ (|d_k|² I − d_k d_kᵀ), d_k = x_k − x̄.
///   So Σ f and Σ x × f survive to round-off on surfaces that do not coincide, in 2D and in 3D.
/// - `conjugate_values` is the transpose of `forces` with the couple. Where the surfaces coincide
///   it equals `values`. Where they do not, `forces` and `values` are not each other's transpose:
///   the work Σ f·u differs between the two sides by Σ ((x − Px) × f) · (mean rotation of the
///   face). With `conjugate_values` it is the same for any field, and a rigid rotation reaches x
///   as ω × x and not as ω × Px.
///
/// Nodes that cannot carry their couple (all on a line, and the couple has a part about that
/// line) share it with those of the faces around them. Where even
/// these cannot carry it, what they can is carried and the point counts in `couples_lost`. If all
/// points of both surfaces lie at z = 0 the problem is plane: forces are taken to have no z
/// component, couples are about z, and two nodes carry them.
class Mapping {
 public:
  /// Points of `from` that none of its faces names carry nothing and have no partner, unless `from`
  /// has no faces at all: then it is a cloud and every point counts.
  /// @throws std::invalid_argument when max_distance is not above zero, or a point that matters is
  /// not finite
  Mapping(const geometry::SurfaceMesh& from, const geometry::SurfaceMesh& to,
          const MappingOptions& options);

  /// Conservative. @param from  one force per point of `from` [N]; @param to  overwritten, one per
  /// node of `to` [N]. The forces of unmapped points arrive nowhere: the caller refuses a mapping
  /// that has any. Allocates nothing. @throws std::invalid_argument when a length is wrong
  void forces(std::span<const Vec3> from, std::span<Vec3> to) const;

  /// Hᵀ without couples: of what is no force, a stiffness or a mass. Arguments as above.
  void shares(std::span<const Vec3> from, std::span<Vec3> to) const;

  /// Consistent. @param to  values at the nodes of `to`, any unit; @param from  overwritten, values
  /// at the points of `from`; zero where a point has no partner. Allocates nothing. @throws
  /// std::invalid_argument when a length is wrong
  void values(std::span<const Vec3> to, std::span<Vec3> from) const;

  /// The transpose of `forces`, otherwise as `values`: keeps Σ f·u between the sides. For
  /// displacements and velocities.
  void conjugate_values(std::span<const Vec3> to, std::span<Vec3> from) const;

  std::size_t from_count() const { return starts_.size() - 1; }
  std::size_t to_count() const { return to_count_; }

  /// Points of `from` with no face of `to` within max_distance, and which they are, ascending.
  std::size_t unmapped() const { return unmapped_.size(); }
  std::span<const std::uint32_t> unmapped_points() const { return unmapped_; }
  /// Largest distance of a mapped point from its face, or node [m]; 0 without any.
  double worst_distance() const { return worst_distance_; }
  /// Points of a mapping by overlap over which no face lies, and which took the nearest face.
  std::size_t uncovered() const { return uncovered_; }
  /// The point of `from` that the worst distance belongs to.
  std::uint32_t worst_point() const { return worst_point_; }
  /// Points whose couple stands on the neighbours of its face as well.
  std::size_t couples_spread() const { return couples_spread_; }
  /// Points that have a force whose couple nothing near can carry.
  std::size_t couples_lost() const { return couples_lost_; }

 private:
  class Builder;

  /// The couple of a point off its face: turn = J⁺ [x − Px]×, on nodes of its own.
  struct Couple {
    std::uint32_t point;
    Eigen::Matrix3d turn;  // [1/m]
  };

  std::size_t to_count_;
  // Row i of H: nodes_ and weights_ from starts_[i] to starts_[i + 1]; empty without a partner.
  std::vector<std::size_t> starts_{0};
  std::vector<std::uint32_t, io::LargeMemory<std::uint32_t>> nodes_;
  std::vector<double, io::LargeMemory<double>> weights_;
  // Couple c: couple_nodes_ and arms_ (x_k − x̄) from couple_starts_[c] to couple_starts_[c + 1].
  std::vector<Couple> couples_;
  std::vector<std::size_t> couple_starts_{0};
  std::vector<std::uint32_t, io::LargeMemory<std::uint32_t>> couple_nodes_;
  std::vector<Vec3, io::LargeMemory<Vec3>> arms_;  // [m]

  std::vector<std::uint32_t> unmapped_;
  double worst_distance_ = 0;
  std::uint32_t worst_point_ = 0;
  std::size_t uncovered_ = 0;
  std::size_t couples_spread_ = 0;
  std::size_t couples_lost_ = 0;
};

}  // namespace acopla::coupler
