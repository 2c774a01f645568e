// A law of its own under the name of a built-in one.
#include "restated_linear.h"

struct Impostor : restated::Linear {
  static constexpr const char* name = "hertz";
};

ACOPLA_LAWS(laws) { laws.add<Impostor, acopla::dem::Frictionless, acopla::dem::FreeRolling>(); }
