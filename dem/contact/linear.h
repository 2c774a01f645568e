#pragma once

#include "dem/contact/kinematics.h"

namespace acopla::dem {

/// Linear spring–dashpot normal contact without tension (Cundall & Strack 1979; Nasato 2011, eq. 11–13).
struct Linear {
  static constexpr const char* name = "linear";
  struct Parameters {
    double stiffness;      ///< k [N/m]
    double damping_ratio;  ///< c / (2 sqrt(k m*)); from the restitution (dem/contact/restitution.h)
  };
  static Parameters from(const PairProperties& pair) { return {pair.stiffness, pair.damping_ratio}; }

  template <class Real>
  static Real stiffness(const Kinematics<Real>&, const Parameters& p) {
    return p.stiffness;
  }
  /// @return normal force [N], ≥ 0
  template <class Real>
  static Real force(const Kinematics<Real>& k, const Parameters& p) {
    using std::max, std::sqrt;
    return max(Real(0), p.stiffness * k.overlap + 2 * p.damping_ratio * sqrt(p.stiffness * k.reduced_mass) * k.closing_speed);
  }
};

/// Nasato (2011), eq. 12 with its errata: the linear spring that stores the energy of a Hertzian impact at speed V,
/// k = (16/15) sqrt(R*) Y* [15 m* V² / (16 sqrt(R*) Y*)]^(1/5) [N/m].
inline double stiffness_of_impact(double modulus, double reduced_radius, double reduced_mass, double speed) {
  const double hertz = 16.0 / 15.0 * std::sqrt(reduced_radius) * modulus;
  return hertz * std::pow(reduced_mass * speed * speed / hertz, 0.2);
}

}  // namespace acopla::dem
