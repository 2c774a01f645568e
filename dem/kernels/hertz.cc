#include "dem/engine_of.h"
#include "dem/kernels/kernels.h"

namespace acopla::dem {

std::unique_ptr<Engine> hertz_engine(const Scene& scene, Particles particles, WallSet walls) {
  return std::make_unique<EngineOf<ContactModel<Hertz, Frictionless, FreeRolling>>>(scene, std::move(particles), std::move(walls));
}

std::unique_ptr<Engine> hertz_rolling_engine(const Scene& scene, Particles particles, WallSet walls) {
  return std::make_unique<EngineOf<ContactModel<Hertz, Frictionless, ConstantTorque>>>(scene, std::move(particles), std::move(walls));
}

}  // namespace acopla::dem
