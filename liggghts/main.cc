#include <fmt/format.h>
#include <sys/prctl.h>

#include <csignal>
#include <cstdio>

#include "io/error.h"
#include "liggghts/solver.h"
#include "protocol/program.h"

namespace {

using namespace acopla;

// Of every process but the first.
int follow(liggghts::Team& team) {
  try {
    liggghts::Engine(team).follow();
    return team.end(liggghts::order_end, io::exit_done);
  } catch (const std::exception& error) {
    // The first tells what all have met.
    fmt::print(stderr, "acopla-liggghts: process {}: {}\n", team.rank(), error.what());
    return team.end(liggghts::order_end, io::exit_failure);
  }
}

}  // namespace

int main(int argc, char** argv) {
  // mpirun puts its processes into groups of their own: they must go when it does, whatever ends it.
  const bool launched = liggghts::Team::is_launched();
  if (launched) prctl(PR_SET_PDEATHSIG, SIGKILL);
  std::setvbuf(stdout, nullptr, _IOLBF, BUFSIZ);  // MPI_Abort flushes nothing

  std::unique_ptr<liggghts::Team> team;
  if (launched) team = std::make_unique<liggghts::Team>();
  if (team && !team->leads()) return follow(*team);
  protocol::Program program;
  program.solver = "liggghts";
  program.make = [&](const io::Table& root, const std::string& name) { return std::make_unique<liggghts::Solver>(root, name, team); };
  program.explain = liggghts::explain;
  const int code = protocol::run_program(argc, argv, program);
  return team ? team->end(liggghts::order_end, code) : code;
}
