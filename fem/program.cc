#include "fem/program.h"

#include "fem/structure.h"

namespace acopla::fem {

protocol::Program program() {
  return {.solver = "fem",
          .make = [](const io::Table& root,
                     const std::string& name) -> std::unique_ptr<protocol::Participant> {
            return std::make_unique<Structure>(read_settings(root, name));
          },
          .explain = [](const io::Table& root,
                        const std::string& name) { return explain(read_settings(root, name)); }};
}

}  // namespace acopla::fem
