#pragma once

#include <array>

#include "dem/contact/slider.h"
#include "dem/contact/pair_properties.h"

namespace acopla::dem {

/// Elastic-plastic spring–dashpot rolling resistance (Iwashita & Oda 1998; Jiang, Yu & Harris 2005; model C of Ai et al. 2011;
/// Gomes 2014, eq. 2.57–2.79 and 2.100–2.103): a spring k_r = k_t R² on the relative rotation, that yields at μ_r R F_n and is damped
/// by 2 η sqrt(I_r k_r) only while it has not yielded. The relative rotation is dθ_r = (ω_i − ω_j) Δt: the printed (2.58) and (2.68)
/// depend on the observer's own rotation. In three dimensions the part along the normal is twisting, a spring and a yield of its own
/// (`twisting`): the area of contact that resists it is smaller than the arm of rolling.
struct ElasticPlastic {
  static constexpr const char* name = "elastic_plastic";
  static constexpr bool needs_friction = true;
  static constexpr std::array fields{
      Field{"damping_ratio", "", io::non_negative, 0.3, "η_r: share of critical damping of the rolling spring"},
      Field{"stiffness_factor", "", io::positive, 1.0, "k_r over k_t R²"},
      Field{"twisting", "", io::non_negative, 0.0, "twisting spring and yield over those of rolling; 0: none"}};
  struct Parameters {
    double friction;  ///< μ_r
    double damping;   ///< 2 η_r
    double stiffness; ///< k_r / (k_t R²)
    double twisting;  ///< of rolling's spring and yield
  };
  static Parameters from(const PairProperties& pair) {
    return {pair.rolling_friction, 2 * pair.rolling_values[0], pair.rolling_values[1], pair.rolling_values[2]};
  }

  /// Elastic rolling torque on i [N m]; in three dimensions also the twisting torque along the normal.
  template <class K, int dimension = K::dimension>
  struct History {
    typename K::Turn torque;
  };
  template <class K>
  struct History<K, 3> {
    typename K::Turn torque;
    typename K::Real twist;
  };
  template <int dimension>
  static constexpr auto stored = [] {
    if constexpr (dimension == 2) return std::array{Stored::torque};
    else return std::array{Stored::torque, Stored::scalar};
  }();

  /// k_r [N m/rad], eq. 2.100
  template <class K>
  static typename K::Real stiffness(const K& k, const typename K::Real& shear_stiffness, const Parameters& p) {
    return p.stiffness * shear_stiffness * k.reduced_radius * k.reduced_radius;
  }
  /// c_r [N m s/rad], eq. 2.101–2.102
  template <class K>
  static typename K::Real dashpot(const K& k, const typename K::Real& shear_stiffness, const Parameters& p) {
    using std::sqrt;
    return p.damping * sqrt(k.rolling_inertia * stiffness(k, shear_stiffness, p));
  }

  /// @param shear  the tangential law's spring. Where it softens, those of rolling and twisting do, and give that share of their torque
  /// back (see Mindlin::spring)
  /// @return torque on i [N m]; −torque acts on j. `energy`: what the springs store [J]; `work`: what they took in the step [J]
  template <class K>
  static typename K::Turn torque(const K& k, const typename K::Real& normal_force, const ShearSpring<typename K::Real>& shear,
                                 const Parameters& p, History<K>& history, typename K::Real& energy, typename K::Real& work) {
    using Real = typename K::Real;
    const Real spring = stiffness(k, shear.stiffness, p), dash = dashpot(k, shear.stiffness, p);
    const Real increment = k.step * stiffness(k, shear.increment, p);
    const Real limit = p.friction * k.reduced_radius * normal_force;
    typename K::Turn turn = k.relative_spin;
    Real twist(0);
    if constexpr (K::dimension == 3) {
      twist = dot(turn, k.normal);
      turn = turn - twist * k.normal;
    }
    auto before = turned_with_frame(history.torque, k);
    const auto yields = slides_at(turned_with_frame(history.torque, k, shear.kept, shear.of) - increment * turn, limit, history.torque);
    typename K::Turn damping = select(yields, Real(0), dash) * turn;
    energy = select(spring > Real(0), dot(history.torque, history.torque) / (2.0 * spring), Real(0));
    work = k.step * dot(damping - Real(0.5) * (before + history.torque), turn);
    typename K::Turn result = history.torque - damping;
    if constexpr (K::dimension == 3) {
      const Real twisting = p.twisting * spring, held = history.twist;
      Vector<Real, 1> kept;
      const auto twists = slides_at(Vector<Real, 1>{shear.share() * held - p.twisting * increment * twist}, p.twisting * limit, kept);
      const Real twist_damping = select(twists, Real(0), p.twisting * dash) * twist;
      history.twist = kept.x;
      energy = energy + select(twisting > Real(0), kept.x * kept.x / (2.0 * twisting), Real(0));
      work = work + k.step * (twist_damping - 0.5 * (held + kept.x)) * twist;
      result = result + (kept.x - twist_damping) * k.normal;
    }
    return result;
  }
};

}  // namespace acopla::dem
