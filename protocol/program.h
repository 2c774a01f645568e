// The one command line that every solver executable has: acopla-dem CASE [--connect ENDPOINT --as NAME].
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "io/case_table.h"
#include "protocol/participant.h"

namespace acopla::protocol {

/// What a solver executable brings; everything else (arguments, errors, exit codes, running alone) is common.
struct Program {
  std::string solver;  ///< value of the `solver` key that names it, e.g. "dem"
  /// Reads and checks the participant's table `name` of the case (root), without reading anything large.
  /// @throws io::UserError
  std::function<std::unique_ptr<Participant>(const io::Table& root, const std::string& name)> make;
  /// A few plain lines for `acopla explain`; may read meshes. @throws io::UserError
  std::function<std::string(const io::Table& root, const std::string& name)> explain;
};

/// Arguments: CASE [--connect ENDPOINT --as NAME] [--results DIR] [--check] [--explain].
/// With --connect it serves the coupler there; without, it runs alone from 0 to the case's `end` in windows of the case,
/// its surfaces at rest and free of load, and prints its quantities at the end. --check reads and checks the table and
/// the files it names, and exits. @return the exit code of io::ExitCode
int run_program(int argc, char** argv, const Program& program);

}  // namespace acopla::protocol
