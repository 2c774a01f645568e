// A supported elastic body and its response to loads that do not depend on time.
#pragma once

#include "fem/elasticity.h"
#include "fem/linear_solver.h"
#include "fem/matrices.h"

namespace acopla::fem {

struct StaticSolution {
  Vector displacement;  ///< u [m], 0 or as prescribed at held unknowns
  /// K u − f [N] at held unknowns, the force of the supports on the body; 0 at free ones.
  Vector reaction;
  /// |K u − f| / (|K| |u| + |f|) at free unknowns: the backward error in the maximum norm.
  double residual = 0;
  int dimension = 3;
  Vec3 total_reaction() const { return total(reaction, dimension); }  ///< [N]
};

class Statics {
 public:
  /// Assembles the stiffness and analyses it; prepare() does the rest.
  /// @param mesh, fixed  must outlive this
  Statics(const Mesh& mesh, const Materials& materials, const Fixed& fixed,
          const SolverOptions& options, const Formulation& formulation = {});
  /// The same with a stiffness that is there already and outlives this.
  Statics(const Mesh& mesh, const BlockMatrix& stiffness, const Fixed& fixed,
          const SolverOptions& options);
  /// The same on matrices wherever they are.
  Statics(std::shared_ptr<const Matrices> matrices, const Fixed& fixed, const SolverOptions& options);

  /// Factors, or builds the preconditioner.
  void prepare() { chosen_.solver->prepare(); }
  /// @param load   nodal forces f [N], on held unknowns as well: these go straight to the supports
  /// @param guess  displacements to start iterations from; may be empty
  /// @param prescribed  displacements [m] of held unknowns, others are not read; empty: zero
  StaticSolution solve(const Vector& load, const Vector& guess = {},
                       const Vector& prescribed = {}) const;

  double condition() const;  ///< κ of the stiffness at free unknowns, after prepare()
  const ChosenSolver& solver() const { return chosen_; }

 private:
  double free_residual(const Vector& residual) const;

  const Fixed& fixed_;
  std::unique_ptr<const BlockMatrix> own_;
  std::shared_ptr<const Matrices> matrices_;
  double norm_;
  ChosenSolver chosen_;
};

}  // namespace acopla::fem
