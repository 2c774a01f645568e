// Solving K u = f many times over: a factorisation where it fits into memory, else iterations.
#pragma once

#include <memory>
#include <string>

#include "fem/block_matrix.h"
#include "fem/supports.h"

namespace acopla::fem {

struct SolverOptions {
  enum class Kind { automatic, direct, cg };
  Kind kind = Kind::automatic;
  double memory_limit = 4.0 * (1ull << 30);  ///< [bytes] factor above which `automatic` iterates
  /// Relative residual |K u − f| / |f| at which CG stops. Free residuals r enter the sum of the
  /// reactions by at most sqrt(n) |r|: 1e-12 leaves a force balance of 1e-9 with a million
  /// unknowns.
  double tolerance = 1e-12;
};

class LinearSolver {
 public:
  virtual ~LinearSolver() = default;
  /// Does the work that all right-hand sides share.
  /// @throws io::UserError when the structure is a mechanism, std::runtime_error out of memory
  virtual void prepare() = 0;
  /// @param f  loads [N], one an unknown; those at held unknowns are not read
  /// @param u  on entry a guess, on return the displacements [m], 0 at held unknowns
  /// @throws std::runtime_error when iterations do not converge
  virtual void solve(const Vector& f, Vector& u) = 0;
};

/// A solver that is chosen and analysed, but has not factored anything.
struct ChosenSolver {
  std::unique_ptr<LinearSolver> solver;
  bool direct = true;
  double factor_bytes = 0;  ///< of the Cholesky factor, exact; 0 when CG was asked for
  double flops = 0;         ///< of the factorisation
  std::string why;          ///< e.g. "its factor of 0.2 GiB is below the limit of 4 GiB"
  /// What was made for this solver alone; a direct one that is prepared does without.
  std::shared_ptr<const BlockMatrix> matrix = {};
};

/// @param matrix  of the free body; it, the mesh and `fixed` must outlive the solver
ChosenSolver choose_solver(const BlockMatrix& matrix, const Mesh& mesh, const Fixed& fixed,
                           const SolverOptions& options);

/// Conjugate gradients, preconditioned by smoothed aggregation (Trilinos ML) that knows the
/// rigid-body modes (Vaněk, Mandel & Brezina 1996). Arguments as above.
std::unique_ptr<LinearSolver> make_conjugate_gradients(const BlockMatrix& matrix, const Mesh& mesh,
                                                       const Fixed& fixed, double tolerance);

}  // namespace acopla::fem
