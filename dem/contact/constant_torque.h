#pragma once

#include "dem/contact/kinematics.h"

namespace acopla::dem {

/// Rolling resistance of constant torque against the relative spin (Nasato 2011, eq. 10 as corrected: the relative spin,
/// equal and opposite on the two bodies).
struct ConstantTorque {
  static constexpr const char* name = "constant_torque";
  struct Parameters {
    double friction;  ///< μ_r
  };
  static Parameters from(const PairProperties& pair) { return {pair.rolling_friction}; }

  /// The torque is capped so that it cannot reverse the relative spin within a step. A sphere may touch twelve others,
  /// each capped alone; explicit damping of neighbours that spin against each other is stable while the sum over contacts
  /// of 2 (I*/I) cap stays below 2, so the cap takes an eighth of the spin a step.
  static constexpr double share = 0.125;

  /// @return torque on i [N m]; −torque acts on j
  template <class Real>
  static Vector3<Real> torque(const Kinematics<Real>& k, const Real& normal_force, const Parameters& p) {
    using std::min, std::sqrt;
    const Real spin = sqrt(dot(k.relative_spin, k.relative_spin));
    // As a factor of the relative spin: what the law asks over |ω|, or the cap, whichever is less.
    const Real cap = (share / k.step) * k.reduced_inertia;
    const Real asked = select(spin > Real(0), p.friction * normal_force * k.reduced_radius / spin, Real(0));
    return -min(asked, cap) * k.relative_spin;
  }
};

struct FreeRolling {
  static constexpr const char* name = "none";
  struct Parameters {};
  static Parameters from(const PairProperties&) { return {}; }
};

}  // namespace acopla::dem
