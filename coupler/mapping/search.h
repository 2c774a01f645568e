// Finds the face of a surface that a point belongs to.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "coupler/mapping/face_shape.h"
#include "geometry/bucket_grid.h"
#include "geometry/surface_mesh.h"

namespace acopla::coupler {

struct Partner {
  std::uint32_t face = 0;
  FaceProjection projection;   ///< of the point on the face
  std::uint32_t examined = 0;  ///< faces that the point was projected on to find this one
};

/// Nearest faces of a surface, by buckets at O(1) a point that lies about a face away, with the
/// exhaustive search as the oracle. Of faces whose distances are within `tie_tolerance()` of the
/// least, both give the one with the lowest index: a point on an edge or corner that faces share
/// has one partner, whatever the round-off.
class PartnerSearch {
 public:
  /// @param surface  must outlive the search and keep its points
  /// @throws std::invalid_argument when a point of a face is not finite
  explicit PartnerSearch(const geometry::SurfaceMesh& surface);
  explicit PartnerSearch(geometry::SurfaceMesh&&) = delete;

  /// Nearest face to `x` [m] within `max_distance` [m] (which may be infinite), or nothing. Nothing
  /// for an `x` with a NaN.
  /// @param guess  a face that may be near, as that of the point before: the answer is the same, and comes sooner
  std::optional<Partner> nearest(const Vec3& x, double max_distance, std::optional<std::uint32_t> guess = {}) const;

  /// The same by looking at every face.
  std::optional<Partner> nearest_exhaustive(const Vec3& x, double max_distance) const;

  double tie_tolerance() const { return tie_; }  ///< 1e-12 of the surface's extent [m]

  /// Calls `visit(face)` for every face whose box touches the box [low, high], for some more than once.
  template <class Visit>
  void for_each_touching(const Vec3& low, const Vec3& high, Visit&& visit) const {
    grid_.for_each_near(low, high, [&](std::uint32_t face) {
      const auto& box = boxes_[face];
      if ((low.array() <= box.high.array()).all() && (high.array() >= box.low.array()).all()) visit(face);
    });
  }

 private:
  FaceProjection project(std::uint32_t face, const Vec3& x) const;
  /// The face near the box x ± reach whose own box is centred nearest to x: a good first guess, so
  /// that few others need a projection.
  std::optional<std::uint32_t> nearest_middle(const Vec3& x, double reach) const;

  const geometry::SurfaceMesh& surface_;
  std::vector<geometry::Box> boxes_;  // of the faces
  geometry::BucketGrid grid_;
  double tie_ = 0;
};

}  // namespace acopla::coupler
