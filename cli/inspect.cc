#include "cli/inspect.h"

#include <fmt/format.h>

#include <cstdio>

#include "cli/participants.h"
#include "coupler/case.h"
#include "coupler/replay.h"

namespace acopla::cli {
namespace {

// Asks every solver for what it says of its own table. @return the worst exit code
int ask_participants(const coupler::Case& read, const std::string& case_file,
                     const std::string& option) {
  int worst = io::exit_done;
  for (const auto& participant : read.participants) {
    std::fflush(stdout);
    try {
      if (participant.replay) {
        coupler::Replay(*participant.replay, participant.name);
        continue;
      }
      auto command = command_of(participant, case_file, "");
      if (!participant.command.empty()) continue;  // its table is its own affair
      command.words.push_back(option);
      if (option == "--explain") fmt::print("\n[{}]\n", participant.name);
      std::fflush(stdout);
      worst = std::max(worst, run_and_wait(command));
    } catch (const io::UserError& error) {
      fmt::print(stderr, "{}\n", error.what());
      worst = std::max<int>(worst, io::exit_user_error);
    }
  }
  return worst;
}

std::string loads_text(const coupler::Case& read) {
  switch (read.loads) {
    case coupler::Loads::history:
      return fmt::format("every window from {:.6g} s on is sent to the receivers",
                         read.time(read.loads_from));
    case coupler::Loads::mean:
      return fmt::format("receivers get the mean from {:.6g} s to {:.6g} s, once",
                         read.time(read.load_start), read.time(read.load_end));
    case coupler::Loads::running_mean:
      return fmt::format("every window from {:.6g} s on is sent to the receivers, as the mean over the {:.6g} s before its end",
                         read.time(read.loads_from), read.time(read.load_windows));
    case coupler::Loads::peak:
      return fmt::format("receivers get the largest force of each node from {:.6g} s to {:.6g} s, once",
                         read.time(read.load_start), read.time(read.load_end));
    case coupler::Loads::snapshot:
      return fmt::format("receivers get the window that ends at {:.6g} s, once",
                         read.time(read.load_end));
  }
  return "";
}

}  // namespace

int check(const std::string& case_file) {
  const auto read = coupler::read_case(io::Table::from_file(case_file));
  const int worst = ask_participants(read, case_file, "--check");
  if (worst == io::exit_done) fmt::print("{}: good\n", case_file);
  return worst;
}

int explain(const std::string& case_file) {
  const auto read = coupler::read_case(io::Table::from_file(case_file));
  fmt::print("{}: {} dimensions, {:.6g} s in {} windows of {:.6g} s\n", read.title, read.dimension,
             read.end, read.windows, read.window);
  fmt::print("{}\n", read.interfaces.empty() ? "alone: coupled to nothing"
                                             : "one-way coupling; " + loads_text(read));
  for (const auto& interface : read.interfaces)
    fmt::print("  forces of {}, mapped conservatively, at most {:.6g} m apart\n", interface.text(),
               read.max_distance);
  if (!read.interfaces.empty())
    fmt::print("pictures of the loaded surfaces every {:.6g} s\n", read.time(read.output_every));
  fmt::print("every window's quantities in interface.h5\n");
  for (const auto& expectation : read.expectations)
    fmt::print("expected: {} = {:.10g}, {} tolerance {:.3g}\n", expectation.name, expectation.value,
               expectation.relative ? "relative" : "absolute", expectation.tolerance);
  return ask_participants(read, case_file, "--explain");
}

}  // namespace acopla::cli
