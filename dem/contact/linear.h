#pragma once

#include <array>

#include "dem/contact/kinematics.h"
#include "dem/contact/pair_properties.h"

namespace acopla::dem {

/// Linear spring–dashpot normal contact without tension (Cundall & Strack 1979; Gomes 2014, eq. 2.31–2.37; Nasato 2011, eq. 11–13).
struct Linear {
  static constexpr const char* name = "linear";
  static constexpr bool needs_moduli = false;
  static constexpr std::array fields{
      Field{"stiffness", "N/m", io::positive, Field::optional, "normal spring"},
      Field{"characteristic_velocity", "m/s", io::positive, Field::optional,
            "impact speed whose Hertzian energy the spring stores (Nasato 2011, eq. 12)"},
      Field{"drop_height", "m", io::positive, Field::optional,
            "fall whose energy the spring stores at an overlap of max_overlap times the smallest radius (Gomes 2014, eq. 2.90)"},
      Field{"max_overlap", "", io::Range{0, 0.5, true, false, ""}, 0.05, "with drop_height: largest overlap over the smallest radius"}};
  struct Parameters {
    double stiffness;      ///< k [N/m] (per metre of depth in 2D)
    double damping_ratio;  ///< c / (2 sqrt(k m*)); from the restitution (dem/contact/restitution.h)
  };
  static Parameters from(const PairProperties& pair) { return {pair.stiffness, pair.damping_ratio}; }
  template <class K>
  struct History {};
  template <int>
  static constexpr std::array<Stored, 0> stored{};

  template <class K>
  static typename K::Real stiffness(const K&, const Parameters& p) {
    return p.stiffness;
  }
  template <class K>
  static typename K::Real impedance(const K& k, const Parameters& p) {
    using std::sqrt;
    return sqrt(p.stiffness * k.reduced_mass);
  }
  template <class K>
  static typename K::Real dashpot(const K& k, const Parameters& p) {
    return 2 * p.damping_ratio * impedance(k, p);
  }
  template <class K>
  static typename K::Real elastic_force(const K& k, const Parameters& p, const History<K>&) {
    return p.stiffness * k.overlap;
  }
  template <class K>
  static typename K::Real energy(const K& k, const Parameters& p, const History<K>&) {
    return 0.5 * p.stiffness * k.overlap * k.overlap;
  }
  /// @return normal force [N], ≥ 0
  template <class K>
  static typename K::Real force(const K& k, const Parameters& p, History<K>& history) {
    using std::max;
    return max(typename K::Real(0), elastic_force(k, p, history) + dashpot(k, p) * k.closing_speed);
  }
};

/// Nasato (2011), eq. 12 with its errata: the linear spring that stores the energy of a Hertzian impact at speed V,
/// k = (16/15) sqrt(R*) Y* [15 m* V² / (16 sqrt(R*) Y*)]^(1/5) [N/m].
inline double stiffness_of_impact(double modulus, double reduced_radius, double reduced_mass, double speed) {
  const double hertz = 16.0 / 15.0 * std::sqrt(reduced_radius) * modulus;
  return hertz * std::pow(reduced_mass * speed * speed / hertz, 0.2);
}

/// Gomes (2014), eq. 2.90: the spring that stops a body of mass m falling from h at the overlap δ, k = 2 m g h / δ² [N/m].
inline double stiffness_of_fall(double mass, double gravity, double height, double overlap) {
  return 2 * mass * gravity * height / (overlap * overlap);
}

}  // namespace acopla::dem
