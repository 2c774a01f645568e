// How each participant of a case is started.
#pragma once

#include <string>

#include "cli/process.h"
#include "coupler/case.h"

namespace acopla::cli {

/// The command of a participant that is a process of its own (not a record). @param endpoint  of
/// the coupler; empty for
/// --check and --explain. @throws io::UserError, located, when there is no such program
Command command_of(const coupler::ParticipantCase& participant, const std::string& case_file,
                   const std::string& endpoint);

/// acopla-coupler with the arguments given, for a case.
Command coupler_command(const std::string& case_file,
                        const std::optional<coupler::Substitute>& substitute);

}  // namespace acopla::cli
