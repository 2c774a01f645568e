// The walls of a scene: planes and triangles in one numbered set, and which of them each particle may touch.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "dem/contact/vector3.h"
#include "dem/particles.h"
#include "geometry/bucket_grid.h"
#include "io/stl.h"

namespace acopla::dem {

/// A named wall of the case: one plane, or a triangle mesh.
struct Wall {
  std::string name;
  std::uint8_t material = 0;
  bool is_plane = false;
  Vec3 point = Vec3::Zero(), normal = Vec3::UnitZ();  ///< of the plane; particles stay where (x − point)·normal > 0
  io::TriangleMesh mesh;                              ///< of a mesh
};

/// Where a particle's surface comes nearest to an element (a triangle or a plane).
struct NearestPoint {
  std::uint32_t element = 0;
  double distance = 0;             ///< from the centre [m]; a plane's may be negative (the centre is behind it)
  Vec3 point = Vec3::Zero();       ///< on the element [m]
  Vec3 normal = Vec3::Zero();      ///< unit, from the element to the centre
  std::array<double, 3> weights{}; ///< barycentric weights of `point` in the triangle
  std::array<std::uint32_t, 3> feature{};  ///< vertices of the edge or corner it lies on
  std::uint8_t feature_size = 0;           ///< 0: inside the element; 1: at a vertex; 2: on an edge
};

class WallSet {
 public:
  explicit WallSet(std::vector<Wall> walls);

  bool empty() const { return element_wall_.empty(); }
  const std::vector<Wall>& walls() const { return walls_; }
  std::size_t element_count() const { return element_wall_.size(); }
  std::uint32_t wall_of(std::uint32_t element) const { return element_wall_[element]; }
  bool is_triangle(std::uint32_t element) const { return element < triangles_.size(); }
  /// Vertices of a triangle, numbered through all meshes; a wall's own begin at first_vertex(wall).
  const std::array<std::uint32_t, 3>& triangle(std::uint32_t element) const { return triangles_[element].vertices; }
  const std::vector<Vec3>& vertices() const { return vertices_; }
  std::uint32_t first_vertex(std::size_t wall) const { return first_vertex_[wall]; }
  std::uint32_t first_triangle(std::size_t wall) const { return first_triangle_[wall]; }

  /// Elements within `reach` of a point, in ascending order, appended to `found`.
  void find_near(const Vec3& centre, double reach, std::vector<std::uint32_t>& found) const;
  /// True when the element is nearer than `radius`; then `nearest` is filled.
  bool touches(std::uint32_t element, const Vec3& centre, double radius, NearestPoint& nearest) const;
  /// Bounding box of all vertices; planes have none.
  const geometry::Box* bounds() const { return triangles_.empty() ? nullptr : &bounds_; }

 private:
  struct Triangle {
    std::array<std::uint32_t, 3> vertices;
    Vec3 normal;    // unit
    Vec3 centre;    // of the smallest ball around the corners' mean
    double radius;  // of that ball [m]
  };
  std::vector<Wall> walls_;
  std::vector<Vec3> vertices_;
  std::vector<Triangle> triangles_;          // elements 0 … n−1; planes follow
  std::vector<std::uint32_t> plane_wall_;    // wall of each plane
  std::vector<std::uint32_t> element_wall_;  // wall of each element
  std::vector<std::uint32_t> first_vertex_, first_triangle_;
  geometry::Box bounds_{};
  std::vector<geometry::BucketGrid> grid_;  // none or one
};

}  // namespace acopla::dem
