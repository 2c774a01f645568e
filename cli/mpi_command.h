// Participants that run on several processes of their own.
#pragma once

#include <string>

#include "cli/process.h"

namespace acopla::cli {

/// The key `processes` of a participant's table, 1 without it. @throws io::UserError, located, when it is not a count
int processes_of(const std::string& case_file, const std::string& participant);

/// Turns a solver's command into one of so many processes under mpirun, of which the first speaks the protocol; 1 changes nothing.
/// @throws io::UserError, located at the key, where there is no mpirun
void run_on_processes(Command& command, int processes, const std::string& case_file, const std::string& participant);

}  // namespace acopla::cli
