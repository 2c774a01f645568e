#include "fem/program.h"

#include "fem/distributed/distributed_matrices.h"
#include "fem/structure.h"

namespace acopla::fem {

protocol::Program program(Team* team) {
  return {.solver = "fem",
          .make = [team](const io::Table& root, const std::string& name) -> std::unique_ptr<protocol::Participant> {
            return std::make_unique<Structure>(read_settings(root, name), team);
          },
          .explain = [](const io::Table& root,
                        const std::string& name) { return explain(read_settings(root, name)); }};
}

int run(int argc, char** argv) {
  if (Team::started() == 1) return protocol::run_program(argc, argv, program());
  Team team;
  if (team.first()) return team.end(protocol::run_program(argc, argv, program(&team)));
  serve_matrices(team);
  return 0;
}

}  // namespace acopla::fem
