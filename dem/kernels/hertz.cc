#include "dem/kernels/built_in.h"
#include "dem/laws.h"

namespace acopla::dem {

void add_hertz(Laws& laws) { laws.add_with_rolling<Hertz, Frictionless>(); }

}  // namespace acopla::dem
