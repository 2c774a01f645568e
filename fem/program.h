// What the executable acopla-fem brings to the common command line.
#pragma once

#include "protocol/program.h"

namespace acopla::fem {

protocol::Program program();

}  // namespace acopla::fem
