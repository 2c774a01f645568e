// A system of equations whose rows several processes share.
#pragma once

#include <memory>

#include "fem/distributed/partition.h"
#include "fem/supports.h"

namespace acopla::fem {

class BlockMatrix;

/// Conjugate gradients (deal.II) on a Trilinos matrix, preconditioned by smoothed aggregation (ML) that knows the rigid-body modes; each process
/// keeps its rows of the matrix and of the preconditioner. Solutions are refined until their backward error |r| / (|A| |u| + |f|) in the maximum
/// norm is that of rounding, so that they depend on the number of processes by rounding times the condition number alone.
class SharedSystem {
 public:
  /// By all processes at once, as all that follows.
  /// @param matrix  rows of the nodes of this process, of the free body; not kept
  /// @param tolerance  relative residual |r| / |f| at which the iterations stop that refinement then begins from
  SharedSystem(Team& team, const Partition& partition, const Mesh& mesh, const Fixed& fixed, const BlockMatrix& matrix, double tolerance);
  ~SharedSystem();
  /// @param f  at the unknowns of this process, in the partition's order; those held are not read
  /// @param u  on entry a guess, on return 0 at held unknowns. @throws std::runtime_error when iterations do not converge
  void solve(const Vector& f, Vector& u);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace acopla::fem
