#pragma once

#include <array>

#include "dem/contact/kinematics.h"
#include "dem/contact/pair_properties.h"

namespace granular {

using acopla::dem::Field;
using acopla::dem::PairProperties;
using acopla::dem::select;
using acopla::dem::Stored;

/// Normal contact of bodies that yield (Walton & Braun 1986, J. Rheol. 30, 949): along the line k_1 δ while the overlap grows beyond
/// all that the contact has seen, along the steeper line k_2 (δ − δ_0) below that, with δ_0 = (1 − k_1/k_2) δ_max left as the dent.
/// The area between the lines is lost, at any speed: no dashpot. k_2 = k_1/e² + S F_max, where e is the entry's restitution. With the
/// hardening S = 0 an impact returns e exactly; with S the restitution falls with the speed, e = sqrt(ω/(ω/e² + S v)), ω² = k_1/m*.
struct WaltonBraun {
  static constexpr const char* name = "walton_braun";
  static constexpr bool needs_moduli = false;
  static constexpr std::array fields{
      Field{"loading_stiffness", "N/m", acopla::io::positive, Field::required, "k_1: slope of the force while the overlap grows anew"},
      Field{"hardening", "1/m", acopla::io::non_negative, 0.0, "S: growth of the unloading slope with the largest force"}};
  struct Parameters {
    double loading;    ///< k_1 [N/m] (per metre of depth in 2D)
    double unloading;  ///< k_2 of a contact that was never loaded [N/m]
    double hardening;  ///< S [1/m]
  };
  static Parameters from(const PairProperties& pair) {
    const double loading = pair.normal_values[0];
    return {loading, loading / (pair.restitution * pair.restitution), pair.normal_values[1]};
  }

  /// Largest overlap so far [m].
  template <class K>
  struct History {
    typename K::Real deepest;
  };
  template <int>
  static constexpr std::array stored{Stored::scalar};

  /// k_1 [N/m]: what the tangential spring is a share of
  template <class K>
  static typename K::Real stiffness(const K&, const Parameters& p) {
    return p.loading;
  }
  /// k_2 [N/m], the slope that the step must resolve
  template <class K>
  static typename K::Real steepest(const K& k, const Parameters& p) {
    return slope(k.overlap, p);
  }
  /// sqrt(k_1 m*) [N s/m], the unit of the tangential law's dashpot
  template <class K>
  static typename K::Real impedance(const K& k, const Parameters& p) {
    using std::sqrt;
    return sqrt(p.loading * k.reduced_mass);
  }

  /// @return normal force [N], ≥ 0
  template <class K>
  static typename K::Real force(const K& k, const Parameters& p, History<K>& history) {
    using std::max;
    history.deepest = max(history.deepest, k.overlap);
    return unloading_force(k, p, history);
  }
  /// [J]
  template <class K>
  static typename K::Real energy(const K& k, const Parameters& p, const History<K>& history) {
    const auto force = unloading_force(k, p, history);
    return force * force / (2.0 * slope(history.deepest, p));
  }
  /// dE/dδ [N]: all of the force below the largest overlap; while that grows, the share that unloading would return.
  template <class K>
  static typename K::Real elastic_force(const K& k, const Parameters& p, const History<K>& history) {
    using Real = typename K::Real;
    const Real force = unloading_force(k, p, history), steep = slope(history.deepest, p);
    const Real share = (p.loading / steep) * (1.0 - 0.5 * p.hardening * force / steep);
    return select(k.overlap < history.deepest, Real(1), share) * force;
  }

 private:
  // k_2 after that overlap.
  template <class Real>
  static Real slope(const Real& deepest, const Parameters& p) {
    return p.unloading + p.hardening * p.loading * deepest;
  }
  // max(0, k_2 (δ − δ_0)), which is k_1 δ where δ = δ_max.
  template <class K>
  static typename K::Real unloading_force(const K& k, const Parameters& p, const History<K>& history) {
    using std::max;
    using Real = typename K::Real;
    return max(Real(0), p.loading * history.deepest - slope(history.deepest, p) * (history.deepest - k.overlap));
  }
};

}  // namespace granular
