// A contact model: one normal, one tangential and one rolling law, fused into one function by the compiler.
#pragma once

#include <type_traits>

#include "dem/contact/constant_torque.h"
#include "dem/contact/hertz.h"
#include "dem/contact/kinematics.h"
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
  /// What a contact carries from step to step. An empty one is neither stored nor sent.
  using History = typename Tangential::History;
  static constexpr bool has_history = !std::is_same_v<History, None>;

  struct Parameters {
    typename Normal::Parameters normal;
    [[no_unique_address]] typename Tangential::Parameters tangential;
    [[no_unique_address]] typename Rolling::Parameters rolling;
  };
  static Parameters from(const PairProperties& pair) {
    return {Normal::from(pair), Tangential::from(pair), Rolling::from(pair)};
  }

  struct Response {
    Vec3 force = Vec3::Zero();   ///< on i [N]
    Vec3 torque = Vec3::Zero();  ///< rolling torque on i, equal and opposite on j [N m]
    double normal_force = 0;     ///< [N]
  };

  static Response respond(const Kinematics& k, const Parameters& p, History& history) {
    Response response;
    response.normal_force = Normal::force(k, p.normal);
    response.force = response.normal_force * k.normal;
    if constexpr (has_friction)
      response.force += Tangential::template force<Normal>(k, response.normal_force, p.tangential, p.normal, history);
    if constexpr (has_rolling) response.torque = Rolling::torque(k, response.normal_force, p.rolling);
    return response;
  }
};

}  // namespace acopla::dem
