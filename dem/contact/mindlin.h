#pragma once

#include <array>

#include "dem/contact/hertz.h"
#include "dem/contact/slider.h"

namespace acopla::dem {

/// Mindlin tangential contact in increments, with Coulomb's limit (Nasato 2011, eq. 7–9 as corrected: the printed secant
/// law creates energy when the overlap changes; Thornton, Cummins & Cleary 2013).
struct Mindlin {
  static constexpr const char* name = "mindlin";
  static constexpr bool needs_moduli = true;
  static constexpr std::array<Field, 0> fields{};
  struct Parameters {
    double shear_modulus;  ///< G* = 1 / ((2−ν_i)/G_i + (2−ν_j)/G_j) [Pa]
    double impedance;      ///< sqrt(S_t/S_n) = sqrt(4 G*/Y*): from the normal impedance to the tangential one
    double damping;        ///< the normal law's 2 sqrt(5/6) β
    double friction;       ///< μ
  };
  static Parameters from(const PairProperties& pair) {
    return {pair.shear_modulus, std::sqrt(4 * pair.shear_modulus / pair.modulus), pair.hertz_damping, pair.friction};
  }

  /// Elastic force on i [N], and the stiffness of the last step [N/m].
  template <class K>
  struct History {
    typename K::Turn force;
    typename K::Real stiffness;
  };
  template <int>
  static constexpr std::array stored{Stored::force, Stored::scalar};

  /// S_t = 8 G* sqrt(R* δ), eq. 8
  template <class Normal, class K>
  static typename K::Real stiffness(const K& k, const Parameters& p, const typename Normal::Parameters&) {
    using std::sqrt;
    return 8 * p.shear_modulus * sqrt(k.reduced_radius * k.overlap);
  }
  /// Where the contact unloads, the spring of the lost area gives its force back: a spring that keeps its force while it softens creates
  /// energy. Where it loads, the increment is of the mean stiffness over the step: of second order.
  template <class K>
  static ShearSpring<typename K::Real> spring(const typename K::Real& present, const History<K>& history) {
    using std::min;
    using Real = typename K::Real;
    Real lower = min(present, history.stiffness);
    return {present, lower, history.stiffness, 0.5 * (present + lower)};
  }
  template <class Normal, class K>
  static typename K::Real dashpot(const K& k, const Parameters& p, const typename Normal::Parameters& normal) {
    return p.damping * p.impedance * Normal::impedance(k, normal);
  }

  /// @param normal_force  [N]
  /// @return tangential force on i [N]; `before` and history.force: its elastic part at the beginning and at the end of the step
  template <class Normal, class K>
  static typename K::Turn force(const K& k, const typename K::Real& normal_force, const Parameters& p,
                                const typename Normal::Parameters& normal, History<K>& history, typename K::Turn& before) {
    const auto now = spring(stiffness<Normal>(k, p, normal), history);
    before = turned_with_frame(history.force, k);
    history.stiffness = now.stiffness;
    return held_by_friction(turned_with_frame(history.force, k, now.kept, now.of) - (k.step * now.increment) * k.slip, p.friction * normal_force,
                            dashpot<Normal>(k, p, normal), k.slip, history.force);
  }
};

}  // namespace acopla::dem
