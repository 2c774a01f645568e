// Large displacements: total Lagrangian statics.
#pragma once

#include "fem/elasticity.h"
#include "fem/linear_solver.h"
#include "fem/statics.h"

namespace acopla::fem {

/// Internal forces and their derivative at a displacement.
struct Linearisation {
  Vector internal;  ///< ∫ F S ∇N_a dV [N], over the undeformed body
  BlockMatrix tangent;  ///< its derivative [N/m], block by block as Hyperelastic says
};

/// With F = I + ∇u and the law of each cell's material. @param pattern  of the stiffness
Linearisation linearise(const Mesh& mesh, const Materials& materials,
                        const Formulation& formulation, const Vector& displacement,
                        const std::shared_ptr<const CoupledNodes>& pattern);

/// Internal forces of a step of LargeMotion from u₀ to u₁.
struct StepForce {
  Vector internal;         ///< ∫ F_m (S̄ + S_v) ∇N_a dV [N], S_v = viscosity · 𝓒 : ΔE
  double dissipation = 0;  ///< ∫ S_v : ΔE dV [J] ≥ 0
};

/// @param viscosity  c_b / Δt of the stress S_v
/// @param tangent  when not null, overwritten by twice the derivative of `internal` by u₁, made symmetric by taking F_m for F₁ in it: of
/// small steps and displacements the stiffness times 1 + 2 viscosity
StepForce step_force(const Mesh& mesh, const Materials& materials, const Formulation& formulation,
                     const Vector& u0, const Vector& u1, double viscosity, BlockMatrix* tangent);

/// ∫ W dV [J] over the undeformed body.
double strain_energy(const Mesh& mesh, const Materials& materials, const Formulation& formulation, const Vector& displacement);

/// Equilibrium f_int(u) = f by Newton's method with a line search, in as many steps of the load as
/// it takes. Loads keep their direction and the area that they were given on. All given must
/// outlive it.
class LargeDisplacements {
 public:
  LargeDisplacements(const Mesh& mesh, const Materials& materials, const Fixed& fixed,
                     const SolverOptions& options, const Formulation& formulation);

  /// Goes from the equilibrium found last (at first: the undeformed body) to that under a load.
  /// @param load  [N]; @param prescribed  displacements of held unknowns [m], or empty for zero
  /// @throws std::runtime_error when no equilibrium is found, e.g. because the structure buckles
  StaticSolution solve(const Vector& load, const Vector& prescribed = {});
  /// Forgets where it was, and goes on from there next.
  void restart_from(const Vector& displacement, const Vector& load);

  std::size_t iterations() const { return iterations_; }

 private:
  bool equilibrate(const Vector& load, const Vector& prescribed, Vector& displacement);
  double norm_of_free(const Vector& residual) const;

  const Mesh& mesh_;
  const Materials& materials_;
  const Fixed& fixed_;
  SolverOptions options_;
  Formulation formulation_;
  std::shared_ptr<const CoupledNodes> pattern_;
  Vector displacement_, load_;
  std::size_t iterations_ = 0;
};

}  // namespace acopla::fem
