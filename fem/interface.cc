#include "fem/interface.h"

#include <algorithm>
#include <array>
#include <stdexcept>

namespace acopla::fem {

Interface::Interface(const Mesh& mesh, const std::string& group) : dimension_(mesh.dimension()) {
  const auto faces = mesh.boundary(group);
  for (const auto& face : faces)
    nodes_.insert(nodes_.end(), face.used().begin(), face.used().end());
  std::sort(nodes_.begin(), nodes_.end());
  nodes_.erase(std::unique(nodes_.begin(), nodes_.end()), nodes_.end());
  for (const auto node : nodes_) surface_.points.push_back(mesh.points()[node]);
  const auto point_of = [&](std::uint32_t node) {
    return static_cast<std::uint32_t>(std::lower_bound(nodes_.begin(), nodes_.end(), node) -
                                      nodes_.begin());
  };
  for (const auto& face : faces) {
    std::array<std::uint32_t, 9> points;
    const auto used = face.used();
    std::transform(used.begin(), used.end(), points.begin(), point_of);
    surface_.add_face(face.kind, {points.data(), used.size()});
  }
}

void Interface::add_forces(std::span<const Vec3> forces, Vector& load) const {
  if (forces.size() != nodes_.size())
    throw std::invalid_argument("has " + std::to_string(nodes_.size()) + " points, but " +
                                std::to_string(forces.size()) + " forces came");
  for (std::size_t i = 0; i < forces.size(); ++i) {
    if (!forces[i].allFinite())
      throw std::invalid_argument("got a force that is not finite, at point " + std::to_string(i));
    add_at(load, nodes_[i], dimension_, forces[i]);
  }
}

std::vector<Vec3> Interface::values(const Vector& nodal) const {
  std::vector<Vec3> result;
  result.reserve(nodes_.size());
  for (const auto node : nodes_) result.push_back(value_at(nodal, node, dimension_));
  return result;
}

}  // namespace acopla::fem
