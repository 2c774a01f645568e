#include "restated_linear.h"

ACOPLA_LAWS(laws) {
  laws.add_with_rolling<restated::Linear, acopla::dem::Frictionless>();
  laws.add_with_rolling<restated::Linear, restated::Slider>();
}
