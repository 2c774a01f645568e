#pragma once

#include <algorithm>
#include <cmath>
#include <tuple>

#include "dem/contact/kinematics.h"
#include "dem/contact/pair_properties.h"

namespace acopla::dem {

/// Hertz normal contact with a dashpot, without tension (Nasato 2011, eq. 3–6; Tsuji, Tanaka & Ishida 1992).
struct Hertz {
  static constexpr const char* name = "hertz";
  static constexpr const char* doc = "Hertz's elastic contact with a dashpot set by the restitution; never pulls";
  struct Parameters {
    double modulus;  ///< Y* = 1 / ((1−ν_i²)/E_i + (1−ν_j²)/E_j) [Pa]
    double damping;  ///< 2 sqrt(5/6) β; from the restitution (dem/contact/restitution.h)
  };
  static Parameters from(const PairProperties& pair) { return {pair.modulus, pair.hertz_damping}; }
  using History = None;

  /// S_n = 2 Y* sqrt(R* δ) [N/m], eq. 5
  static double stiffness(const Kinematics& k, const Parameters& p) {
    return 2 * p.modulus * std::sqrt(k.reduced_radius * k.overlap);
  }
  /// @return normal force [N], ≥ 0
  static double force(const Kinematics& k, const Parameters& p) {
    const double stiffness = Hertz::stiffness(k, p);
    return std::max(0.0, 2.0 / 3.0 * stiffness * k.overlap +
                             p.damping * std::sqrt(stiffness * k.reduced_mass) * k.closing_speed);
  }
};

}  // namespace acopla::dem
