// Moving the particles: velocity Verlet with predicted velocities, which is leapfrog for forces of position and stays of second order
// with dashpots (Groot & Warren 1997, λ = 1):
//   x += v Δt + a Δt²/2,  ṽ = v + a Δt,  a' = F(x, ṽ)/m + g,  v = ṽ + (a' − a) Δt/2.
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

/// One part of a step, for the particles first … last − 1.
///  drift: from a whole step, moves positions and predicts velocities; reads earlier_force, leaves force as it is.
///  kick: completes the velocities with the forces summed at the new positions.
/// Between whole steps earlier_force holds the forces of the last step and force is zero; kick_drift() does both in one pass and
/// leaves zeros in earlier_force. After kick() and after kick_drift() the caller swaps the two arrays, of forces and of torques.
Travel drift(Particles& particles, const Vec3& gravity, double step, std::uint32_t first, std::uint32_t last);
void kick(Particles& particles, double step, std::uint32_t first, std::uint32_t last);
Travel kick_drift(Particles& particles, const Vec3& gravity, double step, std::uint32_t first, std::uint32_t last);

}  // namespace acopla::dem
