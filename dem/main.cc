#include <fmt/format.h>

#include <cstring>
#include <stdexcept>

#include "dem/explain.h"
#include "dem/laws.h"
#include "dem/laws_table.h"
#include "dem/solver.h"
#include "protocol/program.h"

namespace {

// acopla-dem --laws [LIBRARY…]: what a case may name, with the numbers of each law.
int print_laws(int count, char** libraries) {
  auto laws = acopla::dem::Laws::built_in();
  for (int n = 0; n < count; ++n) try {
      laws.load(libraries[n]);
    } catch (const std::runtime_error& error) {
      fmt::print(stderr, "{} {}\n", libraries[n], error.what());
      return acopla::io::exit_user_error;
    }
  fmt::print("{}", acopla::dem::laws_table(laws));
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  using namespace acopla;
  if (argc > 1 && std::strcmp(argv[1], "--laws") == 0) return print_laws(argc - 2, argv + 2);
  protocol::Program program;
  program.solver = "dem";
  program.make = [](const io::Table& root, const std::string& name) { return std::make_unique<dem::Solver>(root, name); };
  program.explain = dem::explain;
  return protocol::run_program(argc, argv, program);
}
