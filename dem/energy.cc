#include "dem/energy.h"

#include <algorithm>
#include <cmath>

namespace acopla::dem {

void EnergyLedger::step(const ContactEnergy<double>& now, double damping_power, double wall_power, double seconds) {
  const Powers powers{now.normal_dashpot, damping_power, wall_power};
  const double half = 0.5 * seconds;
  sums_.lost_normal += half * (last_.normal + powers.normal);
  tangential_work_ += now.tangential_work;
  rolling_work_ += now.rolling_work;
  sums_.lost_damping += half * (last_.damping + powers.damping);
  sums_.wall_work += half * (last_.walls + powers.walls);
  last_ = powers;
  now_ = now;
}

Energy EnergyLedger::balance(double kinetic, double gravity) {
  Energy energy = sums_;
  energy.kinetic = kinetic;
  energy.gravity = gravity;
  energy.normal = now_.normal;
  energy.tangential = now_.tangential;
  energy.rolling = now_.rolling;
  // What the tangential forces took from the bodies and no spring holds was lost.
  energy.lost_sliding = tangential_work_ - energy.tangential;
  energy.lost_rolling = rolling_work_ - energy.rolling;
  const double present = energy.stored() + energy.lost() - energy.wall_work - energy.added;
  if (!started_) {
    start_ = present;
    started_ = true;
  }
  energy.drift = present - start_;
  scale_ = std::max({scale_, energy.kinetic + energy.normal + energy.tangential + energy.rolling, std::abs(energy.lost()), std::abs(energy.wall_work)});
  // What takes energy away must not give any: a loss below zero was made by the steps as well.
  energy.made = -std::min({0.0, energy.lost_normal, energy.lost_sliding, energy.lost_rolling, energy.lost_damping});
  energy.relative_drift = scale_ > 0 ? std::max(std::abs(energy.drift), energy.made) / scale_ : 0;
  return energy;
}

}  // namespace acopla::dem
