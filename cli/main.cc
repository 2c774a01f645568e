// acopla: the command a user types.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <string_view>

#include "cli/conformance.h"
#include "cli/inspect.h"
#include "cli/run.h"
#include "io/error.h"
#include "protocol/keys.h"

namespace acopla::cli {
namespace {

struct Arguments {
  std::string case_file, results, resume, record, replay_as, replay_of;
  std::optional<double> from, to;
  double at = 0;
};

void add_case(CLI::App* command, Arguments& arguments) {
  command->add_option("case", arguments.case_file, "the case file, e.g. case.toml")->required();
}

void add_results(CLI::App* command, Arguments& arguments) {
  command->add_option("--results", arguments.results,
                      "folder for the results (must not exist; default results/NAME-NNN)");
}

CLI::App* declare_replay(CLI::App& app, Arguments& arguments) {
  auto* replay = app.add_subcommand(
      "replay", "run a case with a record in the place of the participant that sends");
  replay->add_option("record", arguments.record, "an interface.h5, or the results folder it is in")
      ->required();
  add_case(replay, arguments);
  add_results(replay, arguments);
  replay->add_option("--as", arguments.replay_as,
                     "the participant it stands for (default: the only one that sends)");
  replay->add_option("--of", arguments.replay_of,
                     "whose surfaces of the record (default: the same name, or the only one)");
  replay->add_option("--from", arguments.from,
                     "start of the part that is played [s] (default: the record's)");
  replay->add_option("--to", arguments.to, "its end [s] (default: the record's)");
  replay->add_option("--at", arguments.at, "time of this run at which it starts [s] (default 0)");
  return replay;
}

int keys(const std::string& folder) {
  protocol::make_keys(folder);
  fmt::print("{0}/coupler.keys: for `acopla-coupler --keys`, stays on its machine\n"
             "{0}/participant.keys: copy it, secretly, to where participants run (--keys DIR, or ACOPLA_KEYS=DIR)\n", folder);
  return io::exit_done;
}

CLI::App* declare_conformance(CLI::App& app, ConformanceOptions& options, bool& lists) {
  auto* command = app.add_subcommand("conformance", "play the coupler against a participant, and say rule by rule what it does right and wrong");
  command->footer("After -- stands the participant's command, with all that begins with a dash (default: what the case says):\n"
                  "  acopla conformance --use top:force:displacement,velocity -- /usr/bin/python3 plate.py");
  command->add_option("--case", options.case_file, "a case, whose interfaces say what the participant receives and sends");
  command->add_option("--as", options.participant, "its name in the case (default: the only one)");
  command->add_option("--use", options.uses, "without a case: SURFACE:RECEIVES:SENDS, e.g. top:force:displacement,velocity")->allow_extra_args(false);
  command->add_option("--dimension", options.dimension, "without a case: 2 or 3 (default 3)")->check(CLI::IsMember({2, 3}));
  command->add_option("--window", options.window, "length of a window [s] (default: the case's, or 0.01)")->check(CLI::PositiveNumber);
  command->add_option("--answer-limit", options.answer_limit, "longest time for an answer [s] (default 60)")->check(CLI::PositiveNumber);
  command->add_option("--start-limit", options.start_limit, "longest time to hello, and to interface [s] (default 60)")->check(CLI::PositiveNumber);
  command->add_option("--exit-limit", options.exit_limit, "longest time to end when the run is over [s] (default 10)")->check(CLI::PositiveNumber);
  command->add_flag("--quick", options.quick, "leave out what takes ten seconds");
  command->add_flag("--list", lists, "print the rules, and end");
  return command;
}

int main_program(int argc, char** argv) {
  CLI::App app("Acopla couples particles to structures: granular loads on deforming structures.");
  app.set_version_flag("--version", "acopla " ACOPLA_VERSION);
  app.require_subcommand(1);
  Arguments arguments;
  auto* run_command = app.add_subcommand(
      "run", "run a case: start its processes, watch them, show progress and results");
  add_case(run_command, arguments);
  add_results(run_command, arguments);
  run_command->add_option("--resume", arguments.resume, "results of a run that was stopped: go on from its last checkpoint, in the same folder")
      ->excludes("--results");
  auto* check_command =
      app.add_subcommand("check", "check a case and the files it names, without running it");
  add_case(check_command, arguments);
  auto* explain_command =
      app.add_subcommand("explain", "say what a case needs, what it leaves out, and what it costs");
  add_case(explain_command, arguments);
  auto* replay_command = declare_replay(app, arguments);
  ConformanceOptions examined;
  bool lists = false;
  auto* conformance_command = declare_conformance(app, examined, lists);
  // What follows -- is somebody else's command line.
  const bool examines = argc > 1 && std::string_view(argv[1]) == "conformance";
  const auto words = examines ? std::find(argv, argv + argc, std::string_view("--")) : argv + argc;
  if (words != argv + argc) examined.command.assign(words + 1, argv + argc);
  std::string keys_folder;
  auto* keys_command = app.add_subcommand("keys", "make the keys that open tcp beyond loopback: coupler.keys and participant.keys");
  keys_command->add_option("folder", keys_folder, "folder to write them to")->required();
  try {
    app.parse(static_cast<int>(words - argv), argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? io::exit_done : io::exit_user_error;
  }
  if (*run_command) return run({arguments.case_file, arguments.results, std::nullopt, arguments.resume});
  if (*check_command) return check(arguments.case_file);
  if (*explain_command) return explain(arguments.case_file);
  if (*keys_command) return keys(keys_folder);
  if (*conformance_command) return lists ? list_rules() : conformance(examined);
  if (*replay_command)
    return run({arguments.case_file, arguments.results,
                coupler::Substitute{arguments.replay_as,
                                    {arguments.record, arguments.replay_of, arguments.from,
                                     arguments.to, arguments.at}}});
  return io::exit_user_error;
}

}  // namespace
}  // namespace acopla::cli

int main(int argc, char** argv) {
  try {
    return acopla::cli::main_program(argc, argv);
  } catch (const acopla::io::UserError& error) {
    fmt::print(stderr, "{}\n", error.what());
    return acopla::io::exit_user_error;
  } catch (const std::exception& error) {
    fmt::print(stderr, "acopla: {}\n", error.what());
    return acopla::io::exit_failure;
  }
}
