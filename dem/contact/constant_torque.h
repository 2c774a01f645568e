#pragma once

#include <array>

#include "dem/contact/kinematics.h"
#include "dem/contact/pair_properties.h"
#include "dem/contact/slider.h"

namespace acopla::dem {

/// Rolling resistance of constant torque against the relative spin (Nasato 2011, eq. 10 as corrected: the relative spin,
/// equal and opposite on the two bodies).
struct ConstantTorque {
  static constexpr const char* name = "constant_torque";
  static constexpr std::array<Field, 0> fields{};
  struct Parameters {
    double friction;  ///< μ_r
  };
  static Parameters from(const PairProperties& pair) { return {pair.rolling_friction}; }
  template <class K>
  struct History {};
  template <int>
  static constexpr std::array<Stored, 0> stored{};

  /// The torque is capped so that it cannot reverse the relative spin within a step. A sphere may touch twelve others,
  /// each capped alone; explicit damping of neighbours that spin against each other is stable while the sum over contacts
  /// of 2 (I*/I) cap stays below 2, so the cap takes an eighth of the spin a step.
  static constexpr double share = 0.125;

  /// Before the first step, where no time has passed, the cap is not known and there is no torque.
  ///
  /// @param normal_force  [N]
  /// @return torque on i [N m]; −torque acts on j. `energy`: what a spring stores [J]; `work`: what was taken in the step [J]
  template <class K>
  static typename K::Turn torque(const K& k, const typename K::Real& normal_force, const ShearSpring<typename K::Real>&, const Parameters& p,
                                 History<K>&, typename K::Real& energy, typename K::Real& work) {
    using std::min, std::sqrt;
    using Real = typename K::Real;
    energy = Real(0);
    const Real spin = sqrt(dot(k.relative_spin, k.relative_spin));
    // As a factor of the relative spin: what the law asks over |ω|, or the cap, whichever is less.
    const Real cap = (k.step > 0 ? share / k.step : 0.0) * k.reduced_inertia;
    const Real asked = select(spin > Real(0), p.friction * normal_force * k.reduced_radius / spin, Real(0));
    const Real factor = min(asked, cap);
    work = k.step * factor * spin * spin;
    return -factor * k.relative_spin;
  }
};

struct FreeRolling {
  static constexpr const char* name = "none";
  static constexpr std::array<Field, 0> fields{};
  struct Parameters {};
  static Parameters from(const PairProperties&) { return {}; }
  template <class K>
  struct History {};
  template <int>
  static constexpr std::array<Stored, 0> stored{};
};

}  // namespace acopla::dem
