#pragma once

#include <cmath>

#include "dem/contact/kinematics.h"
#include "dem/contact/pair_properties.h"

namespace acopla::dem {

/// Mindlin tangential contact in increments, with Coulomb's limit (Nasato 2011, eq. 7–9 as corrected: the printed secant
/// law creates energy when the overlap changes; Thornton, Cummins & Cleary 2013).
struct Mindlin {
  static constexpr const char* name = "mindlin";
  static constexpr const char* doc = "Mindlin's no-slip stiffness in increments, dashpot while sticking, Coulomb's limit";
  struct Parameters {
    double shear_modulus;  ///< G* = 1 / ((2−ν_i)/G_i + (2−ν_j)/G_j) [Pa]
    double damping;        ///< the normal law's 2 sqrt(5/6) β
    double friction;       ///< μ
  };
  static Parameters from(const PairProperties& pair) {
    return {pair.shear_modulus, pair.hertz_damping, pair.friction};
  }
  struct History {
    Vec3 force = Vec3::Zero();  ///< elastic tangential force on i [N]
    double stiffness = 0;       ///< S_t of the last step [N/m]
    void flip() { force = -force; }
  };

  /// @param normal_force  [N]
  /// @return tangential force on i [N]
  template <class Normal>
  static Vec3 force(const Kinematics& k, double normal_force, const Parameters& p, const typename Normal::Parameters&,
                    History& history) {
    // S_t = 8 G* sqrt(R* δ), eq. 8
    const double stiffness = 8 * p.shear_modulus * std::sqrt(k.reduced_radius * k.overlap);
    Vec3 elastic = history.force;
    turn_with_frame(elastic, k);
    // Where the contact unloads, the spring of the lost area gives its force back; without this, energy is created.
    if (stiffness < history.stiffness) elastic *= stiffness / history.stiffness;
    elastic -= (stiffness * k.step) * k.slip;
    history.stiffness = stiffness;

    const double limit = p.friction * normal_force;
    const double square = elastic.squaredNorm();
    if (square > limit * limit) {  // slides: the spring keeps what friction can hold, no dashpot
      history.force = elastic * (limit / std::sqrt(square));
      return history.force;
    }
    history.force = elastic;
    const Vec3 total = elastic - (p.damping * std::sqrt(stiffness * k.reduced_mass)) * k.slip;
    const double total_square = total.squaredNorm();
    return total_square > limit * limit ? Vec3(total * (limit / std::sqrt(total_square))) : total;
  }
};

}  // namespace acopla::dem
