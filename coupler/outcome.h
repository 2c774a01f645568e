// What a run came to, and summary.json, which says it to other programs.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "coupler/case.h"

namespace acopla::coupler {

enum class Status { met, missed, failed, interrupted };
std::string_view name_of(Status status);

struct Checked {
  Expectation expectation;
  std::optional<double> value;  ///< empty: never reported
  double error = 0;             ///< relative or absolute, as the tolerance is
  bool met = false;
};

/// Worst of all windows and interfaces.
struct Ledgers {
  double force_loss = 0, moment_loss = 0;
  double energy_made = 0;  ///< [J], of all windows; 0 by construction where nothing moves
  std::int64_t iterations = 0;       ///< of all windows
  std::int64_t most_iterations = 0;  ///< of one window
  std::int64_t not_converged = 0;    ///< windows that were accepted all the same
  std::int64_t jumped = 0;           ///< windows that ended on one side of a jump of the forces
  std::int64_t unmapped = 0;
  double worst_distance = 0;  ///< [m]
};

struct ParticipantOutcome {
  std::string name, solver;
  double seconds = 0;           ///< between a request and its answer [s]
  double seconds_waiting = 0;   ///< without a request, while the run went on [s]
  double seconds_starting = 0;  ///< of `seconds`, from welcome to the surfaces [s]
  std::uint64_t steps = 0;
  std::uint64_t peak_bytes = 0;  ///< of the process that speaks
  int processes = 1;             ///< that it is made of, as it says
};

/// Σ force of an interface in its last window, for the table at the end.
struct InterfaceOutcome {
  std::string name;
  geometry::Vec3 sent = geometry::Vec3::Zero(), received = geometry::Vec3::Zero();  ///< [N]
  double loss = 0, worst_loss = 0;  ///< of Σ|F|: in the last window, in the worst
};

struct Outcome {
  Status status = Status::failed;
  int exit_code = 1;
  std::string title;
  double end = 0, reached = 0;  ///< [s]
  std::int64_t windows = 0;     ///< complete
  std::vector<Checked> expectations;
  Ledgers ledgers;
  std::vector<ParticipantOutcome> participants;
  std::vector<InterfaceOutcome> interfaces;
  std::vector<std::pair<std::string, double>>
      quantities;  ///< last value of each, "participant.quantity"
  double seconds = 0;          ///< of the run
  double seconds_windows = 0;  ///< of its windows, without start and end
  struct Error {
    std::string participant, state, message;
  };
  std::optional<Error> error;
};

/// The text of summary.json, schema 1.
std::string summary_text(const Outcome& outcome);
/// The outcome as the launcher reads it: the summary with the interfaces, quantities and exit code.
nlohmann::ordered_json to_json(const Outcome& outcome);
/// JSON whatever the bytes are that a participant put into its messages.
std::string dump(const nlohmann::ordered_json& json, int indent = -1);

}  // namespace acopla::coupler
