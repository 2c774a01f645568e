#include "protocol/program.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>

#include "io/results.h"
#include "protocol/keys.h"
#include "protocol/serve.h"

namespace acopla::protocol {
namespace {

struct Arguments {
  std::string case_file, endpoint, name, results, keys = keys_of_environment();
  bool check = false, explain = false;
};

// The participant this process is: the one named, or the only one of this solver.
std::string find_participant(const io::Table& root, const Program& program, const std::string& asked) {
  std::vector<std::string> found, others;
  for (const auto& [name, table] : root.named_tables()) {
    if (!table.has("solver")) continue;
    (table.text("solver") == program.solver ? found : others).push_back(name);
  }
  if (!asked.empty()) {
    if (std::find(found.begin(), found.end(), asked) != found.end()) return asked;
    const auto nearest = io::nearest_word(asked, found);
    throw io::UserError(root.location(), fmt::format("there is no participant {} with solver = \"{}\".{}", asked, program.solver,
                                                     nearest ? fmt::format(" Did you mean {}?", *nearest) : ""));
  }
  if (found.empty())
    throw io::UserError(root.location(), fmt::format("no table has solver = \"{}\". Add one.", program.solver));
  if (found.size() > 1)
    throw io::UserError(root.location(), fmt::format("{} participants have solver = \"{}\". Name one with --as.", found.size(),
                                                     program.solver));
  return found.front();
}

// Alone: from 0 to the end of the case, its surfaces at rest and free of load.
void run_alone(Participant& participant, const io::Table& root, const std::string& results) {
  const int dimension = participant.introduce().dimension;
  const double end = root.number("end", io::positive);
  double window = end;
  const auto coupling = root.table_or_empty("coupling");
  if (coupling.is_number("window")) window = coupling.number("window", io::positive);
  else if (coupling.is_text("window") && coupling.text("window").starts_with("steps:") && participant.introduce().step > 0)
    window = participant.introduce().step * std::max(1.0, std::atof(coupling.text("window").c_str() + 6));
  const auto windows = std::max<std::int64_t>(1, std::llround(std::ceil(end / window * (1 - 1e-9))));
  Run run;
  run.tick = end / static_cast<double>(windows);
  run.end = windows;
  run.window = 1;
  run.results = results;
  if (root.has("gravity")) {
    const auto gravity = root.vector("gravity", dimension);
    std::copy(gravity.data(), gravity.data() + 3, run.gravity);
  }
  participant.start(run);
  Advance last;
  for (std::int64_t k = 0; k < windows; ++k) {
    last = participant.advance({k, k + 1, run.time(k), run.tick}, {});
    fmt::print("t = {:.6g} s of {:.6g} s, {} steps\n", run.time(k + 1), end, last.steps);
    std::fflush(stdout);
  }
  auto values = last.quantities;
  for (auto& value : participant.finish()) values.push_back(std::move(value));
  for (const auto& [name, number] : values) fmt::print("{:28} {:.10g}\n", name, number);
  fmt::print("results in {}\n", results);
}

int act(const Arguments& arguments, const Program& program) {
  const auto root = io::Table::from_file(arguments.case_file);
  const auto name = find_participant(root, program, arguments.name);
  if (arguments.explain) {
    fmt::print("{}", program.explain(root, name));
    return io::exit_done;
  }
  const auto participant = program.make(root, name);
  if (arguments.check) return io::exit_done;
  if (!arguments.endpoint.empty()) {
    ServeOptions options;
    options.endpoint = arguments.endpoint;
    options.name = name;
    options.keys = arguments.keys;
    serve(*participant, options);
    return io::exit_done;
  }
  run_alone(*participant, root, io::make_results_folder(arguments.case_file, arguments.results));
  return io::exit_done;
}

}  // namespace

int run_program(int argc, char** argv, const Program& program) {
  CLI::App app(fmt::format("acopla-{}: the {} solver, coupled with --connect or alone without.", program.solver, program.solver));
  Arguments arguments;
  app.add_option("case", arguments.case_file, "the case file, e.g. case.toml")->required();
  auto* connect = app.add_option("--connect", arguments.endpoint, "the coupler's address, e.g. tcp://127.0.0.1:5555");
  app.add_option("--keys", arguments.keys, "folder with participant.keys, for tcp beyond loopback (default: ACOPLA_KEYS)");
  app.add_option("--as", arguments.name, "the participant of the case that this process is");
  app.add_option("--results", arguments.results, "folder for the results when alone (must not exist)")->excludes(connect);
  app.add_flag("--check", arguments.check, "check this participant's table and the files it names, and end");
  app.add_flag("--explain", arguments.explain, "say what the scene needs, what was left out, and what it costs, and end");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? io::exit_done : io::exit_user_error;
  }
  try {
    return act(arguments, program);
  } catch (const io::UserError& error) {
    fmt::print(stderr, "{}\n", error.what());
    return io::exit_user_error;
  } catch (const std::exception& error) {
    fmt::print(stderr, "acopla-{}: {}\n", program.solver, error.what());
    return io::exit_failure;
  }
}

}  // namespace acopla::protocol
