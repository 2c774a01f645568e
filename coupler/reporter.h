// Whom the coupler tells how the run goes: a person, the launcher, or a test.
#pragma once

#include <cstdint>
#include <string>

namespace acopla::coupler {

struct Outcome;

class Reporter {
 public:
  virtual ~Reporter() = default;
  /// Open for participants at this address.
  virtual void ready(const std::string& /*endpoint*/) {}
  /// Everybody is there and the surfaces are mapped; `seconds` since the start.
  virtual void assembled(double /*seconds*/) {}
  /// `window` of `windows` are complete, up to `time` [s], after `seconds` of computing windows.
  virtual void progress(std::int64_t /*window*/, std::int64_t /*windows*/, double /*time*/,
                        double /*seconds*/) {}
  /// Something worth a line in the log that does not stop the run.
  virtual void note(const std::string& /*text*/) {}
  virtual void done(const Outcome& /*outcome*/) {}
};

}  // namespace acopla::coupler
