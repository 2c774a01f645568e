// A contact model: one normal, one tangential and one rolling law, fused into one function by the compiler.
#pragma once

#include <array>
#include <type_traits>

#include "dem/contact/constant_torque.h"
#include "dem/contact/hertz.h"
#include "dem/contact/linear.h"
#include "dem/contact/linear_slider.h"
#include "dem/contact/mindlin.h"

namespace acopla::dem {

/// Where the energy of contacts is and where it went, of one contact or summed. Computed only where a scene keeps an energy ledger.
template <class Real>
struct ContactEnergy {
  Real normal = Real(0), tangential = Real(0), rolling = Real(0);  ///< stored in the springs now [J]
  Real normal_dashpot = Real(0);      ///< lost in the normal direction this instant, by dashpot or plastic flow [W]
  Real tangential_work = Real(0);     ///< taken from the bodies by tangential forces in the last step [J]
  Real rolling_work = Real(0);        ///< taken from the bodies by rolling torques in the last step [J]

  Real viscous = Real(0);        ///< normal force beside the elastic one [N]; of one contact
  Real viscous_shear = Real(0);  ///< tangential dashpot times the whole tangential force [N²]; of one contact

  void add(const ContactEnergy& other) {
    normal += other.normal;
    tangential += other.tangential;
    rolling += other.rolling;
    normal_dashpot += other.normal_dashpot;
    tangential_work += other.tangential_work;
    rolling_work += other.rolling_work;
  }
};

template <class NormalLaw, class TangentialLaw, class RollingLaw>
struct ContactModel {
  using Normal = NormalLaw;
  using Tangential = TangentialLaw;
  using Rolling = RollingLaw;
  static constexpr bool has_friction = !std::is_same_v<Tangential, Frictionless>;
  static constexpr bool has_rolling = !std::is_same_v<Rolling, FreeRolling>;
  static constexpr bool rotates = has_friction || has_rolling;

  struct Parameters {
    typename Normal::Parameters normal;
    [[no_unique_address]] typename Tangential::Parameters tangential;
    [[no_unique_address]] typename Rolling::Parameters rolling;
  };
  static Parameters from(const PairProperties& pair) {
    return {Normal::from(pair), Tangential::from(pair), Rolling::from(pair)};
  }

  /// What a contact carries from step to step. Where the laws store nothing, nothing is stored.
  template <class K>
  struct History {
    typename K::Real closing_speed;  // of the last half step, to extrapolate from; 0 where the contact is new
    [[no_unique_address]] typename Normal::template History<K> normal;
    [[no_unique_address]] typename Tangential::template History<K> tangential;
    [[no_unique_address]] typename Rolling::template History<K> rolling;
  };
  template <class K>
  static constexpr std::size_t history_size() {
    std::size_t size = 1;
    const auto count = [&](Stored stored) { size += stored == Stored::scalar ? 1 : static_cast<std::size_t>(K::turns); };
    for (const auto stored : Normal::template stored<K::dimension>) count(stored);
    for (const auto stored : Tangential::template stored<K::dimension>) count(stored);
    for (const auto stored : Rolling::template stored<K::dimension>) count(stored);
    return size;
  }
  /// +1 or −1 for every stored number: its factor when the bodies change names.
  template <class K>
  static constexpr auto swap_signs() {
    std::array<double, history_size<K>()> signs{};
    std::size_t at = 0;
    signs[at++] = 1;  // closing_speed
    const auto add = [&](Stored stored) {
      const bool flips = stored == Stored::torque || (stored == Stored::force && K::dimension == 3);
      for (int n = 0; n < (stored == Stored::scalar ? 1 : K::turns); ++n) signs[at++] = flips ? -1.0 : 1.0;
    };
    for (const auto stored : Normal::template stored<K::dimension>) add(stored);
    for (const auto stored : Tangential::template stored<K::dimension>) add(stored);
    for (const auto stored : Rolling::template stored<K::dimension>) add(stored);
    return signs;
  }

  template <class K>
  struct Response {
    typename K::Real normal;   ///< normal force [N], ≥ 0
    typename K::Turn shear;    ///< tangential force on i [N]; set where the model has friction
    typename K::Turn torque;   ///< rolling torque on i, equal and opposite on j [N m]; set where the model rolls
  };

  /// The same function for particles, planes, triangles, edges and vertices. @param energy  filled unless it is null
  template <class K>
  static Response<K> respond(const K& k, const Parameters& p, History<K>& history, ContactEnergy<typename K::Real>* energy) {
    using Real = typename K::Real;
    const auto touches = k.overlap > Real(0);
    Response<K> response;
    response.normal = select(touches, Normal::force(k, p.normal, history.normal), Real(0));
    if (energy) {
      energy->normal = Normal::energy(k, p.normal, history.normal);
      const Real elastic = Normal::elastic_force(k, p.normal, history.normal);
      energy->viscous = select(touches, response.normal - elastic, Real(0));
      energy->normal_dashpot = energy->viscous * k.closing_speed;
    }
    ShearSpring<Real> shear{Real(0), Real(1), Real(1), Real(0)};
    if constexpr (has_friction) {
      typename K::Turn before;
      shear.stiffness = shear.increment = Tangential::template stiffness<Normal>(k, p.tangential, p.normal);
      if constexpr (requires { Tangential::spring(shear.stiffness, history.tangential); })
        shear = Tangential::spring(shear.stiffness, history.tangential);
      response.shear = Tangential::template force<Normal>(k, response.normal, p.tangential, p.normal, history.tangential, before);
      if (energy) {
        // The spring's mean over the step, and its dashpot: with x_n − x_{n−1} = Δt v_{n−½} the spring's part is exact.
        const auto& elastic = history.tangential.force;
        energy->tangential = select(shear.stiffness > Real(0), dot(elastic, elastic) / (Real(2) * shear.stiffness), Real(0));
        energy->tangential_work = -(Real(k.step) * dot(response.shear - elastic + Real(0.5) * (before + elastic), k.slip));
        energy->viscous_shear = dot(response.shear - elastic, response.shear);
      }
    }
    if constexpr (has_rolling) {
      Real stored, work;
      response.torque = Rolling::torque(k, response.normal, shear, p.rolling, history.rolling, stored, work);
      response.torque = select(touches, response.torque, zero_vector<Real, K::turns>());
      if (energy) {
        energy->rolling = stored;
        energy->rolling_work = work;
      }
    }
    return response;
  }
};

}  // namespace acopla::dem
