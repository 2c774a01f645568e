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

std::string windows_text(const coupler::Case& read) {
  if (read.in_steps.automatic) return fmt::format("windows of 1 to {} steps of the particles, as long as they are stable", coupler::WindowInSteps::longest);
  if (read.in_steps.count > 0) return fmt::format("windows of {} steps of the particles", read.in_steps.count);
  return fmt::format("{} windows of {:.6g} s", read.windows, read.window);
}

std::string mapping_text(const coupler::InterfaceCase& interface) {
  std::string text = interface.mapping == coupler::MappingKind::overlap   ? "by overlap of faces"
                     : interface.mapping == coupler::MappingKind::nearest ? "to the nearest nodes"
                                                                          : "conservatively";
  if (interface.share != 0) text += ", of the points nearer to it than to others";
  if (interface.consistent_motion) text += ", motion by interpolation";
  return text;
}

/// When the load begins that is sent once [s].
double first_load(const coupler::Case& read) {
  const double over = read.times.load_over > 0 ? read.times.load_over : read.window;
  return read.times.load_at - over;
}

std::string loads_text(const coupler::Case& read) {
  switch (read.loads) {
    case coupler::Loads::history:
      return fmt::format("every window from {:.6g} s on is sent to the receivers",
                         read.times.loads_from);
    case coupler::Loads::mean:
      return fmt::format("receivers get the mean from {:.6g} s to {:.6g} s, once",
                         first_load(read), read.times.load_at);
    case coupler::Loads::running_mean:
      return fmt::format("every window from {:.6g} s on is sent to the receivers, as the mean over the {:.6g} s before its end",
                         read.times.loads_from, read.times.load_over);
    case coupler::Loads::peak:
      return fmt::format("receivers get the largest force of each node from {:.6g} s to {:.6g} s, once",
                         first_load(read), read.times.load_at);
    case coupler::Loads::snapshot:
      return fmt::format("receivers get the window that ends at {:.6g} s, once",
                         read.times.load_at);
  }
  return "";
}

std::string scheme_text(const coupler::Case& read) {
  switch (read.scheme) {
    case coupler::SchemeKind::serial_explicit:
      return "two-way coupling, explicit: each window once, the particles first";
    case coupler::SchemeKind::parallel_explicit:
      return "two-way coupling, parallel: both sides at once, each with what the other did in the window before";
    case coupler::SchemeKind::serial_implicit:
      return fmt::format("two-way coupling, implicit: each window repeated until both sides agree to {:.3g}, {} times at most", read.implicit.relative,
                         read.implicit.most_iterations);
    default:
      return "one-way coupling; " + loads_text(read);
  }
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
  fmt::print("{}: {} dimensions, {:.6g} s in {}\n", read.title, read.dimension, read.end, windows_text(read));
  fmt::print("{}\n", read.interfaces.empty() ? "alone: coupled to nothing" : scheme_text(read));
  for (const auto& interface : read.interfaces)
    fmt::print("  forces of {}{}\n", interface.text(),
               interface.recorded_only() ? "" : fmt::format(", mapped {}, at most {:.6g} m apart", mapping_text(interface), read.max_distance));
  if (!read.interfaces.empty())
    fmt::print("pictures of the loaded surfaces every {:.6g} s\n", read.times.output_every);
  fmt::print("every window's quantities in interface.h5\n");
  for (const auto& expectation : read.expectations)
    fmt::print("expected: {} = {:.10g}, {} tolerance {:.3g}\n", expectation.name, expectation.value,
               expectation.relative ? "relative" : "absolute", expectation.tolerance);
  return ask_participants(read, case_file, "--explain");
}

}  // namespace acopla::cli
