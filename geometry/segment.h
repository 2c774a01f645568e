// The nearest point of a segment: what a triangle is in three dimensions.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "geometry/surface_mesh.h"

namespace acopla::geometry {

/// Where on a segment its nearest point lies.
enum class SegmentFeature : std::uint8_t { inside, vertex0, vertex1 };

struct NearestOnSegment {
  std::array<double, 2> weights;  ///< of the ends, ≥ 0, sum 1 to round-off
  Vec3 point;                     ///< [m]
  double squared_distance;        ///< [m²]
  SegmentFeature feature;
};

/// Nearest point of the segment (a, b) to `x`. The segment must have a length.
inline NearestOnSegment nearest_on_segment(const Vec3& x, const Vec3& a, const Vec3& b) {
  const Vec3 along = b - a;
  const double t = along.dot(x - a) / along.squaredNorm();
  if (!(t > 0)) return {{1, 0}, a, (x - a).squaredNorm(), SegmentFeature::vertex0};
  if (!(t < 1)) return {{0, 1}, b, (x - b).squaredNorm(), SegmentFeature::vertex1};
  const Vec3 point = a + t * along;
  return {{1 - t, t}, point, (x - point).squaredNorm(), SegmentFeature::inside};
}

}  // namespace acopla::geometry
