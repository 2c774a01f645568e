// The loop of a solver process: says hello, answers the coupler, and keeps a pulse on a thread of its own.
#pragma once

#include "protocol/session.h"

namespace acopla::protocol {

/// Serves `participant` until the coupler says finish. An exception of the participant travels to the coupler as an
/// `error` message with its words before it leaves this function. @throws what the participant threw; ProtocolError when
/// the coupler breaks the protocol, refuses this solver, or falls silent.
void serve(Participant& participant, const ServeOptions& options);

}  // namespace acopla::protocol
