// The MPI side of a team. Only sources that call MPI include this header.
#pragma once

#include <mpi.h>

#include "fem/distributed/team.h"

namespace acopla::fem {

/// One each, so that what waits in one is not taken for an answer in another.
struct Team::Communicators {
  MPI_Comm orders = MPI_COMM_NULL, work = MPI_COMM_NULL, failures = MPI_COMM_NULL;
};

}  // namespace acopla::fem
