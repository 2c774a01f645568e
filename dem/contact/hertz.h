#pragma once

#include <array>

#include "dem/contact/kinematics.h"
#include "dem/contact/pair_properties.h"

namespace acopla::dem {

/// Hertz normal contact with a dashpot, without tension (Nasato 2011, eq. 3–6; Tsuji, Tanaka & Ishida 1992).
struct Hertz {
  static constexpr const char* name = "hertz";
  static constexpr bool needs_moduli = true;
  static constexpr std::array<Field, 0> fields{};
  struct Parameters {
    double modulus;  ///< Y* = 1 / ((1−ν_i²)/E_i + (1−ν_j²)/E_j) [Pa]
    double damping;  ///< 2 sqrt(5/6) β; from the restitution (dem/contact/restitution.h)
  };
  static Parameters from(const PairProperties& pair) { return {pair.modulus, pair.hertz_damping}; }
  template <class K>
  struct History {};
  template <int>
  static constexpr std::array<Stored, 0> stored{};

  /// S_n = 2 Y* sqrt(R* δ) [N/m], eq. 5
  template <class K>
  static typename K::Real stiffness(const K& k, const Parameters& p) {
    using std::sqrt;
    return 2 * p.modulus * sqrt(k.reduced_radius * k.overlap);
  }
  /// sqrt(S_n m*) [N s/m], the unit of dashpots
  template <class K>
  static typename K::Real impedance(const K& k, const Parameters& p) {
    using std::sqrt;
    return sqrt(stiffness(k, p) * k.reduced_mass);
  }
  /// c_n [N s/m], eq. 4 as corrected
  template <class K>
  static typename K::Real dashpot(const K& k, const Parameters& p) {
    return p.damping * impedance(k, p);
  }
  template <class K>
  static typename K::Real elastic_force(const K& k, const Parameters& p, const History<K>&) {
    return 2.0 / 3.0 * stiffness(k, p) * k.overlap;
  }
  /// ∫ F dδ = 2/5 F δ [J]
  template <class K>
  static typename K::Real energy(const K& k, const Parameters& p, const History<K>& history) {
    return 0.4 * elastic_force(k, p, history) * k.overlap;
  }
  /// @return normal force [N], ≥ 0
  template <class K>
  static typename K::Real force(const K& k, const Parameters& p, History<K>& history) {
    using std::max;
    return max(typename K::Real(0), elastic_force(k, p, history) + dashpot(k, p) * k.closing_speed);
  }
};

}  // namespace acopla::dem
