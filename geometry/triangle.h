// The nearest point of a triangle, shared by the contact search of the particles and the search of the mappings.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>

#include "geometry/surface_mesh.h"

namespace acopla::geometry {

/// Where on a triangle its nearest point lies: inside, on edge k (from vertex k to vertex (k+1) % 3), or at vertex k.
enum class TriangleFeature : std::uint8_t { face, edge0, edge1, edge2, vertex0, vertex1, vertex2 };

struct NearestOnTriangle {
  std::array<double, 3> weights;  ///< barycentric, ≥ 0, sum 1 to round-off
  Vec3 point;                     ///< [m]
  double squared_distance;        ///< [m²]
  TriangleFeature feature;
};

/// Nearest point of the triangle (a, b, c) to `x` by Voronoi regions (Ericson, Real-Time Collision Detection 2005,
/// §5.1.5). The triangle must not be degenerate (area > 0).
NearestOnTriangle nearest_on_triangle(const Vec3& x, const Vec3& a, const Vec3& b, const Vec3& c);

}  // namespace acopla::geometry
