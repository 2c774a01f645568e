#pragma once

#include "dem/contact/kinematics.h"

namespace acopla::dem {

/// Linear tangential spring with Coulomb's slider; the dashpot acts only while it sticks (Gomes 2014, eq. 2.44–2.56).
struct LinearSlider {
  static constexpr const char* name = "linear_slider";
  static constexpr bool has_history = true;
  struct Parameters {
    double ratio;          ///< k_n / k_t
    double damping_ratio;  ///< the normal law's
    double friction;       ///< μ
  };
  static Parameters from(const PairProperties& pair) { return {pair.stiffness_ratio, pair.damping_ratio, pair.friction}; }

  template <class Normal, class Real>
  static Vector3<Real> force(const Kinematics<Real>& k, const Real& normal_force, const Parameters& p,
                             const typename Normal::Parameters& normal, SpringHistory<Real>& history) {
    using std::sqrt;
    const Real stiffness = Normal::stiffness(k, normal) / p.ratio;
    const Vector3<Real> elastic = turned_with_frame(history.force, k) - (k.step * stiffness) * k.slip;
    const Real limit = p.friction * normal_force;
    const auto slides = dot(elastic, elastic) > limit * limit;
    history.stiffness = stiffness;
    history.force = shortened(elastic, limit);
    const Real dashpot = select(slides, Real(0), 2 * p.damping_ratio * sqrt(stiffness * k.reduced_mass));
    return shortened(history.force - dashpot * k.slip, limit);
  }
};

/// Smooth bodies: no tangential force, nothing stored.
struct Frictionless {
  static constexpr const char* name = "none";
  static constexpr bool has_history = false;
  struct Parameters {};
  static Parameters from(const PairProperties&) { return {}; }
};

}  // namespace acopla::dem
