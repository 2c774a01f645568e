// The loop of a solver process: says hello, answers the coupler, and keeps a pulse on a thread of its own.
#pragma once

#include <atomic>
#include <chrono>
#include <memory>
#include <string>

#include "protocol/participant.h"

namespace zmq {
class context_t;
}

namespace acopla::protocol {

struct ServeOptions {
  std::string endpoint;  ///< the coupler's, e.g. "ipc:///tmp/acopla-x/hub", "tcp://127.0.0.1:5555", "inproc://hub"
  std::string name;      ///< this participant's name in the case
  /// Gives up when the coupler was silent for this long (no ping arrived).
  std::chrono::milliseconds patience{10000};
  zmq::context_t* context = nullptr;  ///< shared context, needed for inproc; otherwise one is made
};

/// Serves `participant` until the coupler says finish. An exception of the participant travels to the coupler as an
/// `error` message with its words before it leaves this function. @throws what the participant threw; ProtocolError when
/// the coupler breaks the protocol, refuses this solver, or falls silent.
void serve(Participant& participant, const ServeOptions& options);

}  // namespace acopla::protocol
