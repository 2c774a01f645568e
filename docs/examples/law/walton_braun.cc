#include "walton_braun.h"

#include "dem/laws.h"

ACOPLA_LAWS(laws) {
  using namespace acopla::dem;
  laws.add_with_rolling<granular::WaltonBraun, Frictionless>();
  laws.add_with_rolling<granular::WaltonBraun, LinearSlider>();
}
