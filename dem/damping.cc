#include "dem/damping.h"

#include <cmath>

namespace acopla::dem {
namespace {

// Against `velocity`: viscous, and a share of the force that is not balanced.
double resistance(double viscous, double local, double unbalanced, double velocity) {
  double force = -viscous * velocity;
  if (velocity != 0) force -= local * std::copysign(std::abs(unbalanced), velocity);
  return force;
}

}  // namespace

double damp(const Damping& damping, Particles& particles, const Vec3& gravity, std::uint32_t first, std::uint32_t last) {
  double power = 0;
  const bool plane = particles.kind.dimension == 2;
  const auto take = [&](double& force, double viscous, double weight, double velocity) {
    const double added = resistance(viscous, damping.local, force + weight, velocity);
    force += added;
    power -= added * velocity;
  };
  for (auto i = first; i < last; ++i) {
    auto& f = particles.force[i];
    const auto& v = particles.velocity[i];
    const double mass = v.w, inertia = particles.inertia_of(i);
    take(f.x, damping.translation * mass, mass * gravity[0], v.x);
    take(f.y, damping.translation * mass, mass * gravity[1], v.y);
    if (plane) take(f.z, damping.rotation * inertia, 0, v.z);
    else take(f.z, damping.translation * mass, mass * gravity[2], v.z);
    if (particles.has_spins()) {
      auto& t = particles.torque[i];
      const auto& w = particles.spin[i];
      take(t.x, damping.rotation * inertia, 0, w.x);
      take(t.y, damping.rotation * inertia, 0, w.y);
      take(t.z, damping.rotation * inertia, 0, w.z);
    }
  }
  return power;
}

}  // namespace acopla::dem
