#pragma once

#include "dem/contact/kinematics.h"

namespace acopla::dem {

/// Hertz normal contact with a dashpot, without tension (Nasato 2011, eq. 3–6; Tsuji, Tanaka & Ishida 1992).
struct Hertz {
  static constexpr const char* name = "hertz";
  struct Parameters {
    double modulus;  ///< Y* = 1 / ((1−ν_i²)/E_i + (1−ν_j²)/E_j) [Pa]
    double damping;  ///< 2 sqrt(5/6) β; from the restitution (dem/contact/restitution.h)
  };
  static Parameters from(const PairProperties& pair) { return {pair.modulus, pair.hertz_damping}; }

  /// S_n = 2 Y* sqrt(R* δ) [N/m], eq. 5
  template <class Real>
  static Real stiffness(const Kinematics<Real>& k, const Parameters& p) {
    using std::sqrt;
    return 2 * p.modulus * sqrt(k.reduced_radius * k.overlap);
  }
  /// @return normal force [N], ≥ 0
  template <class Real>
  static Real force(const Kinematics<Real>& k, const Parameters& p) {
    using std::max, std::sqrt;
    const Real stiffness = Hertz::stiffness(k, p);
    return max(Real(0), 2.0 / 3.0 * stiffness * k.overlap + p.damping * sqrt(stiffness * k.reduced_mass) * k.closing_speed);
  }
};

}  // namespace acopla::dem
