// Why a run ended before its time.
#pragma once

#include <stdexcept>
#include <string>

namespace acopla::coupler {

/// A participant (or the coupler itself, or an interface beyond a limit) ended the run.
class Failure : public std::runtime_error {
 public:
  enum class Cause { fault, mistake, limit };  ///< exit codes 1, 2 and 3

  Failure(std::string participant, std::string state, const std::string& message,
          Cause cause = Cause::fault)
      : std::runtime_error(message),
        participant_(std::move(participant)),
        state_(std::move(state)),
        cause_(cause) {}
  const std::string& participant() const { return participant_; }
  const std::string& state() const {
    return state_;
  }  ///< what it was doing, e.g. "advancing from 0.1 s to 0.2 s"
  Cause cause() const { return cause_; }

 private:
  std::string participant_, state_;
  Cause cause_;
};

/// Ctrl-C, or the launcher asked for an end.
class Interrupted : public std::runtime_error {
 public:
  Interrupted() : std::runtime_error("the run was interrupted") {}
};

}  // namespace acopla::coupler
