#pragma once

#include <cmath>

#include "dem/contact/kinematics.h"
#include "dem/contact/pair_properties.h"

namespace acopla::dem {

/// Linear tangential spring with Coulomb's slider; the dashpot acts only while it sticks (Gomes 2014, eq. 2.44–2.56).
struct LinearSlider {
  static constexpr const char* name = "linear_slider";
  static constexpr const char* doc = "linear tangential spring with Coulomb's slider, dashpot while sticking";
  struct Parameters {
    double ratio;          ///< k_n / k_t
    double damping_ratio;  ///< the normal law's
    double friction;       ///< μ
  };
  static Parameters from(const PairProperties& pair) {
    return {pair.stiffness_ratio, pair.damping_ratio, pair.friction};
  }
  struct History {
    Vec3 force = Vec3::Zero();  ///< elastic tangential force on i [N]
    double spare = 0;           // a whole record of four doubles
    void flip() { force = -force; }
  };

  template <class Normal>
  static Vec3 force(const Kinematics& k, double normal_force, const Parameters& p, const typename Normal::Parameters& normal,
                    History& history) {
    const double stiffness = Normal::stiffness(k, normal) / p.ratio;
    Vec3 elastic = history.force;
    turn_with_frame(elastic, k);
    elastic -= (stiffness * k.step) * k.slip;
    const double limit = p.friction * normal_force;
    const double square = elastic.squaredNorm();
    if (square > limit * limit) {
      history.force = elastic * (limit / std::sqrt(square));
      return history.force;
    }
    history.force = elastic;
    const Vec3 total = elastic - (2 * p.damping_ratio * std::sqrt(stiffness * k.reduced_mass)) * k.slip;
    const double total_square = total.squaredNorm();
    return total_square > limit * limit ? Vec3(total * (limit / std::sqrt(total_square))) : total;
  }
};

/// Smooth bodies: no tangential force, nothing stored.
struct Frictionless {
  static constexpr const char* name = "none";
  static constexpr const char* doc = "smooth bodies: no tangential force";
  struct Parameters {};
  static Parameters from(const PairProperties&) { return {}; }
  using History = None;
};

}  // namespace acopla::dem
