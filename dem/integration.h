// Moving the particles: leapfrog.
//   v_{n+½} = v_{n−½} + a_n Δt,  x_{n+1} = x_n + v_{n+½} Δt,  a_n = F_n/m + g,
// with v_½ = v_0 + a_0 Δt/2 at the start of a window and v_N = v_{N−½} + a_N Δt/2 at its end.
#pragma once

#include "dem/particles.h"

namespace acopla::dem {

/// How far particles moved in one step.
struct Travel {
  double bound = 0;    ///< no particle moved farther [m]; at most sqrt(3) times the farthest
  bool finite = true;  ///< no coordinate became infinite or not a number
  void include(const Travel& other) {
    bound = other.bound > bound ? other.bound : bound;
    finite = finite && other.finite;
  }
};

/// For the particles first … last − 1: velocities by `kick` [s] with the forces there are, then positions by `step` [s]; the forces are
/// used up, and zero afterwards.
Travel move(Particles& particles, const Vec3& gravity, double kick, double step, std::uint32_t first, std::uint32_t last);
/// Velocities alone; the forces stay.
void kick(Particles& particles, const Vec3& gravity, double kick, std::uint32_t first, std::uint32_t last);

}  // namespace acopla::dem
