// acopla: the command a user types.
#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "cli/inspect.h"
#include "cli/run.h"
#include "io/error.h"

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
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? io::exit_done : io::exit_user_error;
  }
  if (*run_command) return run({arguments.case_file, arguments.results, std::nullopt, arguments.resume});
  if (*check_command) return check(arguments.case_file);
  if (*explain_command) return explain(arguments.case_file);
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
