#include "dem/engine.h"

#include <array>
#include <stdexcept>

#include "dem/contact/model.h"
#include "dem/kernels/kernels.h"

namespace acopla::dem {

double Engine::kinetic_energy() const {
  double energy = 0;
  const auto& p = particles();
  for (std::size_t i = 0; i < p.size(); ++i) energy += 0.5 * p.velocity[i].w * p.velocity[i].vector().squaredNorm();
  for (std::size_t i = 0; i < p.spin.size(); ++i) energy += 0.5 * p.spin[i].w * p.spin[i].vector().squaredNorm();
  return energy;
}

double Engine::mass() const {
  double mass = 0;
  for (const auto& v : particles().velocity) mass += v.w;
  return mass;
}

Vec3 Engine::momentum() const {
  Vec3 momentum = Vec3::Zero();
  for (const auto& v : particles().velocity) momentum += v.w * v.vector();
  return momentum;
}

bool rotates(const LawSet& laws) { return laws.tangential != "none" || laws.rolling != "none"; }

std::unique_ptr<Engine> make_engine(const Scene& scene, Particles particles) {
  return make_engine(scene, std::move(particles), WallSet(scene.walls));
}

std::unique_ptr<Engine> make_engine(const Scene& scene, Particles particles, WallSet walls) {
  struct Entry {
    const char *normal, *tangential, *rolling;
    std::unique_ptr<Engine> (*make)(const Scene&, Particles, WallSet);
  };
  static constexpr std::array entries{
      Entry{Hertz::name, Frictionless::name, FreeRolling::name, hertz_engine},
      Entry{Hertz::name, Frictionless::name, ConstantTorque::name, hertz_rolling_engine},
      Entry{Hertz::name, Mindlin::name, FreeRolling::name, hertz_mindlin_engine},
      Entry{Hertz::name, Mindlin::name, ConstantTorque::name, hertz_mindlin_rolling_engine},
      Entry{Linear::name, Frictionless::name, FreeRolling::name, linear_engine},
      Entry{Linear::name, Frictionless::name, ConstantTorque::name, linear_rolling_engine},
      Entry{Linear::name, LinearSlider::name, FreeRolling::name, linear_slider_engine},
      Entry{Linear::name, LinearSlider::name, ConstantTorque::name, linear_slider_rolling_engine}};
  for (const auto& entry : entries)
    if (scene.laws.normal == entry.normal && scene.laws.tangential == entry.tangential && scene.laws.rolling == entry.rolling)
      return entry.make(scene, std::move(particles), std::move(walls));
  throw std::logic_error("no engine for the laws " + scene.laws.text());
}

}  // namespace acopla::dem
