// A contact model: one normal, one tangential and one rolling law, fused into one function by the compiler.
#pragma once

#include <type_traits>

#include "dem/contact/constant_torque.h"
#include "dem/contact/hertz.h"
#include "dem/contact/linear.h"
#include "dem/contact/linear_slider.h"
#include "dem/contact/mindlin.h"

namespace acopla::dem {

template <class NormalLaw, class TangentialLaw, class RollingLaw>
struct ContactModel {
  using Normal = NormalLaw;
  using Tangential = TangentialLaw;
  using Rolling = RollingLaw;
  static constexpr bool has_friction = !std::is_same_v<Tangential, Frictionless>;
  static constexpr bool has_rolling = !std::is_same_v<Rolling, FreeRolling>;
  /// Whether a contact carries a SpringHistory from step to step. Where not, none is stored.
  static constexpr bool has_history = Tangential::has_history;

  struct Parameters {
    typename Normal::Parameters normal;
    [[no_unique_address]] typename Tangential::Parameters tangential;
    [[no_unique_address]] typename Rolling::Parameters rolling;
  };
  static Parameters from(const PairProperties& pair) {
    return {Normal::from(pair), Tangential::from(pair), Rolling::from(pair)};
  }

  template <class Real>
  struct Response {
    Vector3<Real> force;   ///< on i [N]
    Vector3<Real> torque;  ///< rolling torque on i, equal and opposite on j [N m]; set where the model rolls
  };

  /// The same function for one contact with anything, and for four contacts of particles at a time.
  template <class Real>
  static Response<Real> respond(const Kinematics<Real>& k, const Parameters& p, SpringHistory<Real>& history) {
    Response<Real> response;
    const Real normal_force = Normal::force(k, p.normal);
    response.force = normal_force * k.normal;
    if constexpr (has_friction)
      response.force = response.force + Tangential::template force<Normal>(k, normal_force, p.tangential, p.normal, history);
    if constexpr (has_rolling) response.torque = Rolling::torque(k, normal_force, p.rolling);
    return response;
  }
};

}  // namespace acopla::dem
