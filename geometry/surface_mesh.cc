#include "geometry/surface_mesh.h"

#include <stdexcept>

namespace acopla::geometry {

std::size_t nodes_of(FaceKind kind) {
  switch (kind) {
    case FaceKind::line2: return 2;
    case FaceKind::line3: return 3;
    case FaceKind::triangle3: return 3;
    case FaceKind::triangle6: return 6;
    case FaceKind::quad4: return 4;
    case FaceKind::quad9: return 9;
  }
  return 0;
}

std::size_t corners_of(FaceKind kind) {
  switch (kind) {
    case FaceKind::line2:
    case FaceKind::line3: return 2;
    case FaceKind::triangle3:
    case FaceKind::triangle6: return 3;
    case FaceKind::quad4:
    case FaceKind::quad9: return 4;
  }
  return 0;
}

std::string_view name_of(FaceKind kind) {
  switch (kind) {
    case FaceKind::line2: return "line2";
    case FaceKind::line3: return "line3";
    case FaceKind::triangle3: return "triangle3";
    case FaceKind::triangle6: return "triangle6";
    case FaceKind::quad4: return "quad4";
    case FaceKind::quad9: return "quad9";
  }
  return "unknown";
}

void SurfaceMesh::add_face(FaceKind kind, std::span<const std::uint32_t> nodes) {
  if (nodes.size() != nodes_of(kind) || nodes.empty())
    throw std::invalid_argument("a face has the wrong number of nodes for its kind");
  for (const auto node : nodes)
    if (node >= points.size()) throw std::invalid_argument("a face names a node that does not exist");
  kinds_.push_back(kind);
  nodes_.insert(nodes_.end(), nodes.begin(), nodes.end());
  offsets_.push_back(nodes_.size());
}

Vec3 SurfaceMesh::centroid() const {
  Vec3 sum = Vec3::Zero();
  for (const auto& point : points) sum += point;
  return points.empty() ? sum : Vec3(sum / static_cast<double>(points.size()));
}

double SurfaceMesh::extent() const {
  if (points.empty()) return 0;
  Vec3 low = points.front(), high = points.front();
  for (const auto& point : points) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  return (high - low).norm();
}

}  // namespace acopla::geometry
