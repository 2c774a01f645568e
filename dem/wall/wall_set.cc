#include "dem/wall/wall_set.h"

#include <algorithm>
#include <cmath>

#include "geometry/triangle.h"

namespace acopla::dem {

WallSet::WallSet(std::vector<Wall> walls) : walls_(std::move(walls)) {
  std::vector<geometry::Box> boxes;
  for (std::size_t w = 0; w < walls_.size(); ++w) {
    first_vertex_.push_back(static_cast<std::uint32_t>(vertices_.size()));
    first_triangle_.push_back(static_cast<std::uint32_t>(triangles_.size()));
    const auto first = first_vertex_.back();
    const auto& mesh = walls_[w].mesh;
    vertices_.insert(vertices_.end(), mesh.points.begin(), mesh.points.end());
    for (const auto& corners : mesh.triangles) {
      Triangle triangle;
      for (std::size_t k = 0; k < 3; ++k) triangle.vertices[k] = first + corners[k];
      const Vec3 &a = vertices_[triangle.vertices[0]], &b = vertices_[triangle.vertices[1]], &c = vertices_[triangle.vertices[2]];
      triangle.normal = (b - a).cross(c - a).normalized();
      triangle.centre = (a + b + c) / 3;
      triangle.radius = std::sqrt(std::max({(a - triangle.centre).squaredNorm(), (b - triangle.centre).squaredNorm(),
                                            (c - triangle.centre).squaredNorm()}));
      boxes.push_back({a.cwiseMin(b).cwiseMin(c), a.cwiseMax(b).cwiseMax(c)});
      triangles_.push_back(triangle);
      element_wall_.push_back(static_cast<std::uint32_t>(w));
    }
  }
  for (std::size_t w = 0; w < walls_.size(); ++w)
    if (walls_[w].is_plane) {
      plane_wall_.push_back(static_cast<std::uint32_t>(w));
      element_wall_.push_back(static_cast<std::uint32_t>(w));
    }
  first_vertex_.push_back(static_cast<std::uint32_t>(vertices_.size()));
  first_triangle_.push_back(static_cast<std::uint32_t>(triangles_.size()));
  if (!boxes.empty()) {
    grid_.emplace_back(boxes);
    bounds_ = grid_[0].bounds();
  }
}

void WallSet::find_near(const Vec3& centre, double reach, std::vector<std::uint32_t>& found) const {
  const auto begin = static_cast<std::ptrdiff_t>(found.size());
  if (!grid_.empty()) {
    const Vec3 half = Vec3::Constant(reach);
    const auto far = reach * reach;
    grid_[0].for_each_near(centre - half, centre + half, [&](std::uint32_t element) {
      const auto& t = triangles_[element];
      const double bound = reach + t.radius;
      if ((centre - t.centre).squaredNorm() > bound * bound || std::abs((centre - t.centre).dot(t.normal)) > reach) return;
      const auto nearest = geometry::nearest_on_triangle(centre, vertices_[t.vertices[0]], vertices_[t.vertices[1]],
                                                         vertices_[t.vertices[2]]);
      if (nearest.squared_distance <= far) found.push_back(element);
    });
    std::sort(found.begin() + begin, found.end());
    found.erase(std::unique(found.begin() + begin, found.end()), found.end());
  }
  for (std::size_t k = 0; k < plane_wall_.size(); ++k) {
    const auto& plane = walls_[plane_wall_[k]];
    if ((centre - plane.point).dot(plane.normal) < reach) found.push_back(static_cast<std::uint32_t>(triangles_.size() + k));
  }
}

bool WallSet::touches(std::uint32_t element, const Vec3& centre, double radius, NearestPoint& nearest) const {
  if (!is_triangle(element)) {
    const auto& plane = walls_[element_wall_[element]];
    const double height = (centre - plane.point).dot(plane.normal);
    if (height >= radius) return false;
    nearest.element = element;
    nearest.distance = height;
    nearest.normal = plane.normal;
    nearest.point = centre - height * plane.normal;
    nearest.feature_size = 0;
    return true;
  }
  const auto& t = triangles_[element];
  const Vec3 from_centre = centre - t.centre;
  const double height = from_centre.dot(t.normal), bound = radius + t.radius;
  if (std::abs(height) >= radius || from_centre.squaredNorm() >= bound * bound) return false;
  const auto found = geometry::nearest_on_triangle(centre, vertices_[t.vertices[0]], vertices_[t.vertices[1]],
                                                   vertices_[t.vertices[2]]);
  if (found.squared_distance >= radius * radius) return false;
  nearest.element = element;
  nearest.weights = found.weights;
  const auto kind = static_cast<int>(found.feature);
  if (found.feature == geometry::TriangleFeature::face) {
    // By the triangle's own normal: the response of a split plane is the plane's to round-off.
    nearest.distance = std::abs(height);
    nearest.normal = height < 0 ? Vec3(-t.normal) : t.normal;
    nearest.feature_size = 0;
  } else {
    nearest.distance = std::sqrt(found.squared_distance);
    nearest.normal = nearest.distance > 0 ? Vec3((centre - found.point) / nearest.distance) : t.normal;
    const bool edge = kind <= static_cast<int>(geometry::TriangleFeature::edge2);
    const auto first = static_cast<std::size_t>(edge ? kind - 1 : kind - 4);
    nearest.feature_size = edge ? 2 : 1;
    nearest.feature[0] = t.vertices[first];
    nearest.feature[1] = t.vertices[(first + 1) % 3];
  }
  nearest.point = found.point;
  return true;
}

}  // namespace acopla::dem
