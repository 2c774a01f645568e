// The list of contact models that are compiled: one line a set of laws. A set that is not here has no engine.
#pragma once

#include <memory>

#include "dem/engine.h"

namespace acopla::dem {

std::unique_ptr<Engine> hertz_engine(const Scene& scene, Particles particles, WallSet walls);
std::unique_ptr<Engine> hertz_mindlin_engine(const Scene& scene, Particles particles, WallSet walls);
std::unique_ptr<Engine> hertz_mindlin_rolling_engine(const Scene& scene, Particles particles, WallSet walls);
std::unique_ptr<Engine> hertz_rolling_engine(const Scene& scene, Particles particles, WallSet walls);
std::unique_ptr<Engine> linear_engine(const Scene& scene, Particles particles, WallSet walls);
std::unique_ptr<Engine> linear_slider_engine(const Scene& scene, Particles particles, WallSet walls);
std::unique_ptr<Engine> linear_slider_rolling_engine(const Scene& scene, Particles particles, WallSet walls);
std::unique_ptr<Engine> linear_rolling_engine(const Scene& scene, Particles particles, WallSet walls);

}  // namespace acopla::dem
