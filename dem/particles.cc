#include "dem/particles.h"

namespace acopla::dem {

double volume_of(int dimension, double radius) {
  return dimension == 2 ? M_PI * radius * radius : 4.0 / 3.0 * M_PI * radius * radius * radius;
}

void Particles::add(const Vec3& at, double radius, double density, std::uint8_t of_material, const Vec3& with_velocity, const Vec3& with_spin) {
  const double mass = density * volume_of(kind.dimension, radius);
  position.push_back({at[0], at[1], at[2], radius});
  velocity.push_back({with_velocity[0], with_velocity[1], kind.dimension == 2 ? with_spin[2] : with_velocity[2], mass});
  force.emplace_back();
  if (has_spins()) {
    spin.push_back({with_spin[0], with_spin[1], with_spin[2], 0.4 * mass * radius * radius});
    torque.emplace_back();
  }
  id.push_back(next_id++);
  material.push_back(of_material);
}

void Particles::set_spin(std::size_t i, const Vec3& value) {
  if (kind.dimension == 2) velocity[i].z = value[2];
  else if (kind.rotates) spin[i].set(value);
}

void Particles::reorder(const std::vector<std::uint32_t>& order) {
  const auto sort = [&](auto& values) {
    if (values.empty()) return;
    auto sorted = values;
    sorted.resize(order.size());
    for (std::size_t k = 0; k < order.size(); ++k) sorted[k] = values[order[k]];
    values.swap(sorted);
  };
  sort(position);
  sort(velocity);
  sort(spin);
  sort(force);
  sort(torque);
  sort(id);
  sort(material);
}

}  // namespace acopla::dem
