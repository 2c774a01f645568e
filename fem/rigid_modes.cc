#include "fem/rigid_modes.h"

#include <Eigen/Geometry>
#include <Teuchos_ParameterList.hpp>

namespace acopla::fem {
namespace {

int count_of(int dimension) { return dimension == 2 ? 3 : 6; }

}  // namespace

std::vector<double> rigid_modes(const Mesh& mesh, std::span<const std::uint32_t> nodes, std::span<const char> fixed) {
  const int dimension = mesh.dimension();
  const auto size = fixed.size();
  std::vector<double> modes(static_cast<std::size_t>(count_of(dimension)) * size, 0.0);
  Vec3 centre = Vec3::Zero();
  for (const auto& p : mesh.points()) centre += p / static_cast<double>(mesh.nodes());
  for (std::size_t n = 0; n < nodes.size(); ++n)
    for (int d = 0; d < dimension; ++d) {
      const auto i = static_cast<std::size_t>(dimension) * n + static_cast<std::size_t>(d);
      if (fixed[i]) continue;
      auto mode = static_cast<std::size_t>(d);
      modes[mode * size + i] = 1;
      mode = static_cast<std::size_t>(dimension);
      for (int axis = dimension == 2 ? 2 : 0; axis < 3; ++axis)
        modes[mode++ * size + i] = Vec3(Vec3::Unit(axis)).cross(mesh.points()[nodes[n]] - centre)[d];
    }
  return modes;
}

void set_rigid_modes(Teuchos::ParameterList& list, int dimension, std::vector<double>& modes) {
  list.set("PDE equations", dimension);
  list.set("null space: type", "pre-computed");
  list.set("null space: dimension", count_of(dimension));
  list.set("null space: vectors", modes.data());
}

}  // namespace acopla::fem
