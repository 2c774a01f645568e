#include "fem/program.h"

#include <cstdlib>
#include <string>

#include "fem/structure.h"
#include "io/error.h"

namespace acopla::fem {

namespace {

/// Open MPI and MPICH say so in the environment; MPI itself is not started to ask.
void refuse_several_processes() {
  for (const char* name : {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE"}) {
    const char* size = std::getenv(name);
    if (size && std::atoi(size) > 1)
      throw io::UserError("acopla-fem runs as one process, and mpirun started " + std::string(size) +
                          ", which would all write the same results. Start it without mpirun.");
  }
}

}  // namespace

protocol::Program program() {
  return {.solver = "fem",
          .make = [](const io::Table& root,
                     const std::string& name) -> std::unique_ptr<protocol::Participant> {
            refuse_several_processes();
            return std::make_unique<Structure>(read_settings(root, name));
          },
          .explain = [](const io::Table& root,
                        const std::string& name) { return explain(read_settings(root, name)); }};
}

}  // namespace acopla::fem
