#include "cli/participants.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>

#include "cli/mpi_command.h"

namespace acopla::cli {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> solvers_beside_us() {
  std::vector<std::string> found;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(own_folder(), error)) {
    const auto name = entry.path().filename().string();
    if (name.starts_with("acopla-") && name != "acopla-coupler") found.push_back(name.substr(7));
  }
  std::sort(found.begin(), found.end());
  return found;
}

// Where `import acopla` finds the Python client; before what the user's own PYTHONPATH names.
std::string python_path() {
  const auto client = fs::path(own_folder()).parent_path() / "share/acopla/python";
  const char* theirs = std::getenv("PYTHONPATH");
  return theirs && *theirs ? client.string() + ":" + theirs : client.string();
}

std::string solver_path(const coupler::ParticipantCase& participant) {
  const bool is_name =
      participant.solver.find('/') == std::string::npos && !participant.solver.empty();
  const auto path = own_folder() + "/acopla-" + participant.solver;
  if (is_name && participant.solver != "coupler" && !find_program(path, "").empty()) return path;
  const auto known = solvers_beside_us();
  const auto near = io::nearest_word(participant.solver, known);
  throw io::UserError(
      participant.at,
      fmt::format("{}.solver = \"{}\" is not a solver of this build. {}", participant.name,
                  participant.solver,
                  near            ? fmt::format("Did you mean \"{}\"?", *near)
                  : known.empty() ? std::string("It has none.")
                                  : fmt::format("There are: {}.", fmt::join(known, ", "))));
}

}  // namespace

Command command_of(const coupler::ParticipantCase& participant, const std::string& case_file,
                   const std::string& endpoint) {
  Command command;
  const auto full = case_file.empty() ? fs::path() : fs::absolute(case_file).lexically_normal();
  command.environment = {{"ACOPLA_ENDPOINT", endpoint},
                         {"ACOPLA_PARTICIPANT", participant.name},
                         {"ACOPLA_CASE", full.string()}};
  if (!participant.solver.empty()) {
    command.words = {solver_path(participant), case_file, "--as", participant.name};
    // A participant that is asked about its table, not run, is one process.
    const int processes = case_file.empty() ? 1 : processes_of(case_file, participant.name);
    if (!endpoint.empty()) command.words.insert(command.words.end(), {"--connect", endpoint});
    if (!endpoint.empty()) run_on_processes(command, processes, case_file, participant.name);
    return command;
  }
  command.environment.emplace_back("PYTHONPATH", python_path());
  command.words = participant.command;
  command.folder =
      full.parent_path().string();  // a script beside the case is named as it is written there
  if (find_program(command.words.front(), command.folder).empty())
    throw io::UserError(
        participant.at,
        fmt::format(
            "{}.command names \"{}\", which is not a program that can be started. Check its "
            "name, and that it may be executed.",
            participant.name, command.words.front()));
  return command;
}

Command coupler_command(const std::string& case_file,
                        const std::optional<coupler::Substitute>& substitute) {
  Command command;
  command.words = {own_folder() + "/acopla-coupler", case_file};
  if (!substitute) return command;
  const auto add = [&](const char* option, const std::string& value) {
    command.words.insert(command.words.end(), {option, value});
  };
  const auto& replay = substitute->replay;
  add("--replay", replay.file);
  if (!substitute->participant.empty()) add("--replay-as", substitute->participant);
  if (!replay.of.empty()) add("--replay-of", replay.of);
  if (replay.from) add("--replay-from", fmt::format("{:.17g}", *replay.from));
  if (replay.to) add("--replay-to", fmt::format("{:.17g}", *replay.to));
  add("--replay-at", fmt::format("{:.17g}", replay.at));
  return command;
}

}  // namespace acopla::cli
