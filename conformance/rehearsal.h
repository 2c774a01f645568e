// One life of a participant's process, with the coupler's part played step by step.
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>
#include <zmq.hpp>

#include "conformance/pulse_log.h"
#include "protocol/exchange.h"
#include "protocol/hub.h"

namespace acopla::conformance {

/// How a process ended.
struct Ending {
  bool killed = false;  ///< by a signal: a crash
  int code = 0;         ///< exit code where it was not
  std::string how;      ///< "ended with exit code 1", "was killed by signal 11 (Segmentation fault)"
};

/// A participant's process, which can be started again and again.
class Subject {
 public:
  virtual ~Subject() = default;
  /// @throws io::UserError when it cannot be started
  virtual void start(const std::string& endpoint) = 0;
  virtual std::optional<Ending> ended() = 0;
  virtual void end() = 0;  ///< at once, with all that it started
  virtual std::string last_words() const = 0;
};

/// What the coupler would tell and allow.
struct Plan {
  std::string participant;
  int dimension = 3;
  protocol::Run run;         ///< with the uses of this participant
  std::string endpoint;      ///< prefix of the addresses to bind
  std::string scratch;       ///< an existing folder for checkpoints
  std::chrono::milliseconds start_limit{60000};   ///< from the start to hello, and from welcome to interface
  std::chrono::milliseconds answer_limit{60000};  ///< of any other answer
  std::chrono::milliseconds exit_limit{10000};
  bool examines_silence = true;  ///< takes more than ten seconds
};

/// A rule is broken; the text says what the participant did. Without a name it is the rule that is being examined.
class Broken : public std::runtime_error {
 public:
  explicit Broken(const std::string& text, std::string_view rule = {}) : std::runtime_error(text), rule_(rule) {}
  std::string_view rule() const { return rule_; }

 private:
  std::string_view rule_;
};

class Rehearsal {
 public:
  using Fields = std::vector<protocol::Field>;

  Rehearsal(Subject& subject, const Plan& plan, bool pings = true);
  ~Rehearsal();
  Rehearsal(const Rehearsal&) = delete;
  Rehearsal& operator=(const Rehearsal&) = delete;

  // --- the coupler's part; each throws Broken ---
  protocol::Hello hear_hello();
  /// @param strange  adds a key that no version knows
  void say_welcome(bool strange = false, bool resumes = false);
  /// The same, with memory to share.
  void say_welcome_with_memory();
  std::vector<protocol::Surface> hear_interface();
  /// hello, welcome, interface
  void open(bool strange = false, bool resumes = false);

  /// Sends a request and waits for its answer, whatever it is.
  protocol::Message ask(protocol::Message request);
  /// The same, and only this kind of answer will do; its number is checked.
  protocol::Message ask(protocol::Message request, protocol::Kind wanted);
  protocol::Message ask(protocol::Kind kind, protocol::Kind wanted);
  protocol::Message advance(std::int64_t window, const Fields& fields);
  protocol::Message advance_request(std::int64_t window, const Fields& fields) const;
  /// Sends without waiting.
  void say(protocol::Message message);
  void say_bytes(const std::vector<std::string>& frames);

  /// An `error` with a text must come, and the process end, neither with exit code 0 nor by a signal.
  void hear_its_error(const std::string& cause);
  /// @return how the process ended within the limit
  Ending hear_its_end(const std::string& cause);
  /// What comes within a time; nothing should.
  std::optional<std::string> hear_anything(std::chrono::milliseconds time);

  // --- fields for it ---
  Fields zero_fields() const;
  /// Small and different for each seed, zero along z in 2D.
  Fields small_fields(int seed) const;
  bool receives() const;
  bool shares_memory() const { return shares_memory_; }  ///< the participant said so

  PulseLog& pulse() { return *pulse_; }
  /// The longest time that it took to answer an advance.
  std::chrono::milliseconds longest_window() const { return longest_window_; }
  const std::vector<protocol::Surface>& surfaces() const { return surfaces_; }

 private:
  protocol::Message hear(std::chrono::milliseconds limit, const std::string& what);
  Fields fields(double amplitude, int seed) const;

  Subject& subject_;
  const Plan& plan_;
  zmq::context_t context_;
  protocol::Hub hub_;
  std::unique_ptr<PulseLog> pulse_;
  std::string peer_;
  std::vector<protocol::Surface> surfaces_;
  bool shares_memory_ = false;
  std::uint64_t sequence_ = 0;
  std::chrono::milliseconds longest_window_{0};
};

}  // namespace acopla::conformance
