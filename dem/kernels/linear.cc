#include "dem/engine_of.h"
#include "dem/kernels/kernels.h"

namespace acopla::dem {

std::unique_ptr<Engine> linear_engine(const Scene& scene, Particles particles, WallSet walls) {
  return std::make_unique<EngineOf<ContactModel<Linear, Frictionless, FreeRolling>>>(scene, std::move(particles), std::move(walls));
}

std::unique_ptr<Engine> linear_rolling_engine(const Scene& scene, Particles particles, WallSet walls) {
  return std::make_unique<EngineOf<ContactModel<Linear, Frictionless, ConstantTorque>>>(scene, std::move(particles), std::move(walls));
}

std::unique_ptr<Engine> linear_slider_engine(const Scene& scene, Particles particles, WallSet walls) {
  return std::make_unique<EngineOf<ContactModel<Linear, LinearSlider, FreeRolling>>>(scene, std::move(particles), std::move(walls));
}

std::unique_ptr<Engine> linear_slider_rolling_engine(const Scene& scene, Particles particles, WallSet walls) {
  return std::make_unique<EngineOf<ContactModel<Linear, LinearSlider, ConstantTorque>>>(scene, std::move(particles), std::move(walls));
}

}  // namespace acopla::dem
