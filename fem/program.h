// What the executable acopla-fem brings to the common command line.
#pragma once

#include "protocol/program.h"

namespace acopla::fem {

class Team;

/// @param team  whose first process this is; null: alone. It must outlive what the program makes.
protocol::Program program(Team* team = nullptr);

/// The executable: alone, or as one of the processes that mpirun started, of which the first speaks and the others keep their share of the
/// matrices. MPI is started under mpirun only. @return the exit code of io::ExitCode
int run(int argc, char** argv);

}  // namespace acopla::fem
