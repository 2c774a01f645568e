#include "dem/explain.h"
#include "dem/solver.h"
#include "protocol/program.h"

int main(int argc, char** argv) {
  using namespace acopla;
  protocol::Program program;
  program.solver = "dem";
  program.make = [](const io::Table& root, const std::string& name) { return std::make_unique<dem::Solver>(root, name); };
  program.explain = dem::explain;
  return protocol::run_program(argc, argv, program);
}
