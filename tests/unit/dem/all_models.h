// The contact models that the property tests run on: every built-in one, and the law of docs/examples/law.
#pragma once

#include <gtest/gtest.h>

#include "dem/laws.h"
#include "docs/examples/law/walton_braun.h"

namespace acopla::dem::test {

template <class Model_, int dimension_>
struct Case {
  using Model = Model_;
  static constexpr int dimension = dimension_;
};

template <class... Models>
using DiscsAndSpheres = ::testing::Types<Case<Models, 2>..., Case<Models, 3>...>;

// A combination that is not here fails PropertyTests.CoverEveryBuiltInLaw.
using AllModels = DiscsAndSpheres<
    ContactModel<Hertz, Frictionless, FreeRolling>, ContactModel<Hertz, Frictionless, ConstantTorque>,
    ContactModel<Hertz, Mindlin, FreeRolling>, ContactModel<Hertz, Mindlin, ConstantTorque>, ContactModel<Hertz, Mindlin, ElasticPlastic>,
    ContactModel<Linear, Frictionless, FreeRolling>, ContactModel<Linear, Frictionless, ConstantTorque>,
    ContactModel<Linear, LinearSlider, FreeRolling>, ContactModel<Linear, LinearSlider, ConstantTorque>,
    ContactModel<Linear, LinearSlider, ElasticPlastic>,
    ContactModel<granular::WaltonBraun, Frictionless, FreeRolling>, ContactModel<granular::WaltonBraun, LinearSlider, FreeRolling>,
    ContactModel<granular::WaltonBraun, LinearSlider, ElasticPlastic>>;

template <class Model>
LawSet names_of() {
  return {Model::Normal::name, Model::Tangential::name, Model::Rolling::name};
}

struct CaseName {
  template <class Case>
  static std::string GetName(int) {
    const auto laws = names_of<typename Case::Model>();
    return laws.normal + "_" + laws.tangential + "_" + laws.rolling + "_" + std::to_string(Case::dimension) + "d";
  }
};

}  // namespace acopla::dem::test
