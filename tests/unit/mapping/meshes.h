// Surfaces that the tests of the mappings share.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <numbers>
#include <random>
#include <vector>

#include "coupler/mapping/face_shape.h"
#include "geometry/surface_mesh.h"

namespace acopla::coupler::testing {

using geometry::SurfaceMesh;

inline constexpr std::array all_kinds{FaceKind::line2,     FaceKind::line3, FaceKind::triangle3,
                                      FaceKind::triangle6, FaceKind::quad4, FaceKind::quad9};
inline constexpr std::array surface_kinds{FaceKind::triangle3, FaceKind::triangle6, FaceKind::quad4,
                                          FaceKind::quad9};

inline bool quadratic(FaceKind kind) {
  return kind == FaceKind::line3 || kind == FaceKind::triangle6 || kind == FaceKind::quad9;
}

/// Adds a patch of nx × ny cells of `kind`, its nodes at position(s, t), s and t in [0, 1]. Nodes
/// are merged only within the patch; patches side by side share positions but not nodes, as STL
/// surfaces do.
inline void add_patch(SurfaceMesh& mesh, FaceKind kind, int nx, int ny,
                      const std::function<Vec3(double, double)>& position) {
  std::map<std::pair<int, int>, std::uint32_t> known;
  const auto node = [&](int i, int j) {  // on the grid of half cells
    const auto [entry, added] =
        known.try_emplace({i, j}, static_cast<std::uint32_t>(mesh.points.size()));
    if (added) mesh.points.push_back(position(0.5 * i / nx, 0.5 * j / ny));
    return entry->second;
  };
  using Offsets = std::vector<std::array<int, 2>>;
  std::vector<Offsets> faces;
  switch (kind) {
    case FaceKind::line2:
      faces = {{{0, 0}, {2, 0}}};
      break;
    case FaceKind::line3:
      faces = {{{0, 0}, {2, 0}, {1, 0}}};
      break;
    case FaceKind::triangle3:
      faces = {{{0, 0}, {2, 0}, {2, 2}}, {{0, 0}, {2, 2}, {0, 2}}};
      break;
    case FaceKind::triangle6:
      faces = {{{0, 0}, {2, 0}, {2, 2}, {1, 0}, {2, 1}, {1, 1}},
               {{0, 0}, {2, 2}, {0, 2}, {1, 1}, {1, 2}, {0, 1}}};
      break;
    case FaceKind::quad4:
      faces = {{{0, 0}, {2, 0}, {2, 2}, {0, 2}}};
      break;
    case FaceKind::quad9:
      faces = {{{0, 0}, {2, 0}, {2, 2}, {0, 2}, {1, 0}, {2, 1}, {1, 2}, {0, 1}, {1, 1}}};
      break;
  }
  for (int j = 0; j < (geometry::corners_of(kind) == 2 ? 1 : ny); ++j)
    for (int i = 0; i < nx; ++i)
      for (const auto& offsets : faces) {
        std::vector<std::uint32_t> nodes;
        for (const auto& [di, dj] : offsets) nodes.push_back(node(2 * i + di, 2 * j + dj));
        mesh.add_face(kind, nodes);
      }
}

/// The unit square at z = 0 (a unit segment along x for lines).
inline SurfaceMesh flat(FaceKind kind, int nx, int ny) {
  SurfaceMesh mesh;
  add_patch(mesh, kind, nx, ny, [](double s, double t) { return Vec3(s, t, 0); });
  return mesh;
}

/// The unit square mapped by an affine map into space.
inline SurfaceMesh skew(FaceKind kind, int nx, int ny) {
  SurfaceMesh mesh;
  add_patch(mesh, kind, nx, ny, [](double s, double t) {
    return Vec3(0.3 + 2 * s + 0.4 * t, 0.1 * s + 1.5 * t, 1 - 0.7 * s + 0.2 * t);
  });
  return mesh;
}

/// The inside of a box of 1 × 1 × 1.6 m, open at the top: five sides.
inline SurfaceMesh open_box(FaceKind kind, int n) {
  SurfaceMesh mesh;
  add_patch(mesh, kind, n, n, [](double s, double t) { return Vec3(s, t, 0); });
  add_patch(mesh, kind, n, n + 1, [](double s, double t) { return Vec3(s, 0, 1.6 * t); });
  add_patch(mesh, kind, n, n + 1, [](double s, double t) { return Vec3(s, 1, 1.6 * t); });
  add_patch(mesh, kind, n, n + 1, [](double s, double t) { return Vec3(0, s, 1.6 * t); });
  add_patch(mesh, kind, n, n + 1, [](double s, double t) { return Vec3(1, s, 1.6 * t); });
  return mesh;
}

/// A drum of radius 0.5 m and length 0.8 m about y whose shell is a polygon of `sides`. Nodes of
/// quadratic faces lie on the circle, all others are corners of the polygon.
inline SurfaceMesh drum(FaceKind kind, int sides, int along) {
  SurfaceMesh mesh;
  add_patch(mesh, kind, sides, along, [&](double s, double t) {
    const double angle = 2 * std::numbers::pi * s;
    return Vec3(0.5 * std::cos(angle), 0.8 * t, 0.5 * std::sin(angle));
  });
  return mesh;
}

/// A ring in the plane z = 0.
inline SurfaceMesh ring(FaceKind kind, int sides, double radius) {
  SurfaceMesh mesh;
  add_patch(mesh, kind, sides, 1, [&](double s, double) {
    const double angle = 2 * std::numbers::pi * s;
    return Vec3(radius * std::cos(angle), radius * std::sin(angle), 0);
  });
  for (auto& point : mesh.points) point.z() = 0;
  return mesh;
}

inline std::vector<Vec3> random_vectors(std::size_t count, unsigned seed, bool plane = false) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> component(-1, 1);
  std::vector<Vec3> vectors(count);
  for (auto& vector : vectors) {
    for (int d = 0; d < 3; ++d) vector[d] = component(random);
    if (plane) vector.z() = 0;
  }
  return vectors;
}

/// Consistent nodal forces of a uniform pressure [1 N/m² along z] on a flat grid of cells that are
/// rectangles cut in parallel: the integrals of the shape functions, as fractions of a face's area.
inline std::vector<Vec3> uniform_pressure(const SurfaceMesh& mesh) {
  static const std::map<FaceKind, std::vector<double>> fractions{
      {FaceKind::line2, {1. / 2, 1. / 2}},
      {FaceKind::line3, {1. / 6, 1. / 6, 4. / 6}},
      {FaceKind::triangle3, {1. / 3, 1. / 3, 1. / 3}},
      {FaceKind::triangle6, {0, 0, 0, 1. / 3, 1. / 3, 1. / 3}},
      {FaceKind::quad4, {1. / 4, 1. / 4, 1. / 4, 1. / 4}},
      {FaceKind::quad9,
       {1. / 36, 1. / 36, 1. / 36, 1. / 36, 4. / 36, 4. / 36, 4. / 36, 4. / 36, 16. / 36}}};
  std::vector<Vec3> forces(mesh.points.size(), Vec3::Zero());
  for (std::size_t face = 0; face < mesh.face_count(); ++face) {
    const auto nodes = mesh.nodes(face);
    const std::size_t corners = geometry::corners_of(mesh.kind(face));
    const Vec3 along = mesh.points[nodes[1]] - mesh.points[nodes[0]];
    const Vec3 across = mesh.points[nodes[corners - 1]] - mesh.points[nodes[0]];
    const double area =
        corners == 2 ? along.norm() : along.cross(across).norm() * (corners == 3 ? 0.5 : 1);
    for (std::size_t k = 0; k < nodes.size(); ++k)
      forces[nodes[k]].z() += area * fractions.at(mesh.kind(face))[k];
  }
  return forces;
}

}  // namespace acopla::coupler::testing
