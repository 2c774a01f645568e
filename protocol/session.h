// The solver's end of a run, for codes that keep their own main loop; serve() is the same with the loop turned round.
//
//   Session session({"my solver", 3}, {endpoint, name});
//   session.offer(surfaces_for(session.run()));
//   for (Window window; session.next(window);) session.answer(compute(window, session.received()));
//   session.finish({});
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

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
  std::string keys = {};  ///< folder with the participant's keys, for tcp beyond loopback; empty: none
};

/// What the coupler may ask between windows; what is empty is answered as unsupported.
struct Handlers {
  std::function<void()> save, restore;
  std::function<void(const std::string& folder)> checkpoint, resume;
};

class Session {
 public:
  /// Says hello and waits for the coupler's welcome; pings are answered from a thread of its own from then on.
  /// @throws ProtocolError when the coupler refuses this solver, or is not there
  Session(const Introduction& introduction, const ServeOptions& options, Handlers handlers = {});
  /// A session that is left before finish() or fail() tells the coupler so.
  ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  const Run& run() const;
  /// The surfaces in their reference position, once, before the first window.
  void offer(const std::vector<Surface>& surfaces);
  /// Waits for the next window, and answers what is asked in between. @return false when the run ends well: then finish()
  /// @throws ProtocolError when the coupler breaks the protocol, ends the run, or falls silent; what a handler throws
  bool next(Window& window);
  /// What came with the window; stays until the next.
  const std::vector<Field>& received() const;
  /// Answers the window.
  void answer(Advance advance);
  /// Answers that the run ends. @param values  for the summary; `peak_bytes` is added
  void finish(std::vector<std::pair<std::string, double>> values);
  /// Tells the coupler why this solver cannot go on; the run ends. Without effect where the coupler knows.
  /// @param mistake  a user's mistake: text is a located sentence that is shown as it is
  void fail(const std::string& text, bool mistake = false) noexcept;

 private:
  class Line;
  std::unique_ptr<Line> line_;
};

}  // namespace acopla::protocol
