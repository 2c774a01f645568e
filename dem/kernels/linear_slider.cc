#include "dem/kernels/built_in.h"
#include "dem/laws.h"

namespace acopla::dem {

void add_linear_slider(Laws& laws) { laws.add_with_rolling<Linear, LinearSlider>(); }

}  // namespace acopla::dem
