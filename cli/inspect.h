// acopla check and acopla explain: the coupler's part of a case here, each participant's by its own
// executable.
#pragma once

#include <string>

namespace acopla::cli {

/// Prints every error found, or "CASE: good". @return the exit code
int check(const std::string& case_file);
/// Prints what the case would do. @return the exit code
int explain(const std::string& case_file);

}  // namespace acopla::cli
