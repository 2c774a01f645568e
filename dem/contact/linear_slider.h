#pragma once

#include <array>
#include <cmath>

#include "dem/contact/linear.h"
#include "dem/contact/slider.h"

namespace acopla::dem {

/// Linear tangential spring with Coulomb's slider; the dashpot acts only while it sticks (Gomes 2014, eq. 2.44–2.56).
struct LinearSlider {
  static constexpr const char* name = "linear_slider";
  static constexpr bool needs_moduli = false;
  static constexpr std::array fields{
      Field{"ratio", "", io::positive, 20, "k_n / k_t"},
      Field{"damping_ratio", "", io::non_negative, Field::optional,
            "tangential dashpot over 2 sqrt(k_t m*); the normal dashpot's ratio unless given. Gomes's eq. 2.98 for discs: 1/sqrt(2) of his"}};
  struct Parameters {
    double inverse_ratio;  ///< k_t / k_n
    double dashpot;        ///< c_t over sqrt(k_n m*): 2 ζ sqrt(k_t/k_n)
    double friction;       ///< μ
  };
  static Parameters from(const PairProperties& pair) {
    const double inverse = 1 / pair.tangential_values[0], own = pair.tangential_values[1];
    return {inverse, 2 * (std::isnan(own) ? pair.damping_ratio : own) * std::sqrt(inverse), pair.friction};
  }

  /// Elastic force on i [N].
  template <class K>
  struct History {
    typename K::Turn force;
  };
  template <int>
  static constexpr std::array stored{Stored::force};

  template <class Normal, class K>
  static typename K::Real stiffness(const K& k, const Parameters& p, const typename Normal::Parameters& normal) {
    return Normal::stiffness(k, normal) * p.inverse_ratio;
  }
  template <class Normal, class K>
  static typename K::Real dashpot(const K& k, const Parameters& p, const typename Normal::Parameters& normal) {
    return p.dashpot * Normal::impedance(k, normal);
  }

  template <class Normal, class K>
  static typename K::Turn force(const K& k, const typename K::Real& normal_force, const Parameters& p,
                                const typename Normal::Parameters& normal, History<K>& history, typename K::Turn& before) {
    before = turned_with_frame(history.force, k);
    return held_by_friction(before - (k.step * stiffness<Normal>(k, p, normal)) * k.slip, p.friction * normal_force,
                            dashpot<Normal>(k, p, normal), k.slip, history.force);
  }
};

/// Smooth bodies: no tangential force, nothing stored.
struct Frictionless {
  static constexpr const char* name = "none";
  static constexpr bool needs_moduli = false;
  static constexpr std::array<Field, 0> fields{};
  struct Parameters {};
  static Parameters from(const PairProperties&) { return {}; }
  template <class K>
  struct History {};
  template <int>
  static constexpr std::array<Stored, 0> stored{};
};

}  // namespace acopla::dem
