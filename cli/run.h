// acopla run: starts the processes of a case, watches them, and ends all of them when one fails.
#pragma once

#include <optional>
#include <string>

#include "coupler/case.h"

namespace acopla::cli {

struct RunOptions {
  std::string case_file;
  std::string results;                            ///< empty: results/NAME-NNN
  std::optional<coupler::Substitute> substitute = {};  ///< acopla replay
  std::string resume = {};  ///< results of a run that is gone on with; `results` is empty then
};

/// @return the exit code. @throws io::UserError for a case that cannot be started
int run(const RunOptions& options);

}  // namespace acopla::cli
