#pragma once

#include "dem/contact/kinematics.h"

namespace acopla::dem {

/// Mindlin tangential contact in increments, with Coulomb's limit (Nasato 2011, eq. 7–9 as corrected: the printed secant
/// law creates energy when the overlap changes; Thornton, Cummins & Cleary 2013).
struct Mindlin {
  static constexpr const char* name = "mindlin";
  static constexpr bool has_history = true;
  struct Parameters {
    double shear_modulus;  ///< G* = 1 / ((2−ν_i)/G_i + (2−ν_j)/G_j) [Pa]
    double damping;        ///< the normal law's 2 sqrt(5/6) β
    double friction;       ///< μ
  };
  static Parameters from(const PairProperties& pair) { return {pair.shear_modulus, pair.hertz_damping, pair.friction}; }

  /// @param normal_force  [N]
  /// @return tangential force on i [N]
  template <class Normal, class Real>
  static Vector3<Real> force(const Kinematics<Real>& k, const Real& normal_force, const Parameters& p,
                             const typename Normal::Parameters&, SpringHistory<Real>& history) {
    using std::sqrt;
    // S_t = 8 G* sqrt(R* δ), eq. 8
    const Real stiffness = 8 * p.shear_modulus * sqrt(k.reduced_radius * k.overlap);
    // Where the contact unloads, the spring of the lost area gives its force back; without this, energy is created.
    const Real kept = select(stiffness < history.stiffness, stiffness / history.stiffness, Real(1));
    const Vector3<Real> elastic = kept * turned_with_frame(history.force, k) - (k.step * stiffness) * k.slip;
    const Real limit = p.friction * normal_force;
    const auto slides = dot(elastic, elastic) > limit * limit;
    history.stiffness = stiffness;
    history.force = shortened(elastic, limit);  // sliding, the spring keeps what friction can hold
    const Real dashpot = select(slides, Real(0), p.damping * sqrt(stiffness * k.reduced_mass));
    return shortened(history.force - dashpot * k.slip, limit);
  }
};

}  // namespace acopla::dem
