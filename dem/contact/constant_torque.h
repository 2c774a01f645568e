#pragma once

#include <algorithm>
#include <cmath>

#include "dem/contact/kinematics.h"
#include "dem/contact/pair_properties.h"

namespace acopla::dem {

/// Rolling resistance of constant torque against the relative spin (Nasato 2011, eq. 10 as corrected: the relative spin,
/// equal and opposite on the two bodies).
struct ConstantTorque {
  static constexpr const char* name = "constant_torque";
  static constexpr const char* doc = "torque of constant size against the relative spin";
  struct Parameters {
    double friction;  ///< μ_r
  };
  static Parameters from(const PairProperties& pair) { return {pair.rolling_friction}; }
  using History = None;

  /// The torque is capped so that it cannot reverse the relative spin within a step. A sphere may touch twelve others,
  /// each capped alone; explicit damping of neighbours that spin against each other is stable while the sum over contacts
  /// of 2 (I*/I) cap stays below 2, so the cap takes an eighth of the spin a step.
  static constexpr double share = 0.125;

  /// @return torque on i [N m]; −torque acts on j
  static Vec3 torque(const Kinematics& k, double normal_force, const Parameters& p) {
    const double spin = k.relative_spin.norm();
    if (!(spin > 0)) return Vec3::Zero();
    const double most = share * spin * k.reduced_inertia / k.step;
    return k.relative_spin * (-std::min(p.friction * normal_force * k.reduced_radius, most) / spin);
  }
};

struct FreeRolling {
  static constexpr const char* name = "none";
  static constexpr const char* doc = "no rolling resistance";
  struct Parameters {};
  static Parameters from(const PairProperties&) { return {}; }
  using History = None;
};

}  // namespace acopla::dem
