#include "dem/particles.h"

#include <cmath>

namespace acopla::dem {

void Particles::add(const Vec3& at, double radius, double density, std::uint8_t of_material, const Vec3& with_velocity) {
  const double mass = density * 4.0 / 3.0 * M_PI * radius * radius * radius;
  position.push_back({at[0], at[1], at[2], radius});
  velocity.push_back({with_velocity[0], with_velocity[1], with_velocity[2], mass});
  force.emplace_back();
  acceleration.emplace_back();
  if (rotates) {
    spin.push_back({0, 0, 0, 0.4 * mass * radius * radius});
    torque.emplace_back();
    angular_acceleration.emplace_back();
  }
  id.push_back(static_cast<std::uint32_t>(id.size()));
  material.push_back(of_material);
}

void Particles::reorder(const std::vector<std::uint32_t>& order) {
  const auto apply = [&](auto& values) {
    if (values.empty()) return;
    auto sorted = values;
    for (std::size_t k = 0; k < order.size(); ++k) sorted[k] = values[order[k]];
    values = std::move(sorted);
  };
  apply(position);
  apply(velocity);
  apply(spin);
  apply(force);
  apply(torque);
  apply(acceleration);
  apply(angular_acceleration);
  apply(id);
  apply(material);
}

}  // namespace acopla::dem
