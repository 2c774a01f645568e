// What a scene needs, what was left out of it, and what it will cost.
#pragma once

#include <string>

#include "io/case_table.h"

namespace acopla::dem {

/// Lines for `acopla explain`. The expected run time comes from a short measurement of the scene's own kernel on a packed
/// lattice. @throws io::UserError
std::string explain(const io::Table& root, const std::string& name);

}  // namespace acopla::dem
