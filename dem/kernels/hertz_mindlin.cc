#include "dem/kernels/built_in.h"
#include "dem/laws.h"

namespace acopla::dem {

void add_hertz_mindlin(Laws& laws) { laws.add_with_rolling<Hertz, Mindlin>(); }

}  // namespace acopla::dem
