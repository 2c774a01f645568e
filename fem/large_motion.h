// A structure in motion under large displacements: M a + C v + f_int(u) = f.
#pragma once

#include <memory>

#include "fem/dynamics.h"

namespace acopla::fem {

/// Dynamics of one body whose displacements and rotations may be large, in steps that keep momentum, angular momentum and energy whatever
/// their length (Simo & Tarnow 1992, Gonzalez 2000): the midpoint rule
///   M (v₁ − v₀)/Δt + c_a M (u₁ − u₀)/Δt + ∫ F_m (S̄ + c_b 𝓒 : ΔE/Δt) ∇N_a dV = F̄,  (u₁ − u₀)/Δt = (v₀ + v₁)/2,
/// with F_m the mean of the deformation gradients at both ends and the stress of their mean C̄ = ½ (C₀ + C₁),
///   S̄ = S(C̄) + 2 (W₁ − W₀ − ½ S(C̄) : ΔC) ΔC / |ΔC|²,
/// whose second part vanishes for St. Venant–Kirchhoff. Of small displacements it is Dynamics with β = ¼, γ = ½. The part of Rayleigh's
/// damping that goes with the stiffness acts on the rate of Green's strain, 𝓒 as of small strains: it lets a rotation alone, which
/// c_b K would not. Loads keep their direction. Everything given must outlive it.
class LargeMotion {
 public:
  LargeMotion(const Mesh& mesh, const Materials& materials, const MassMatrix& mass, const Rayleigh& damping,
              const Supports& supports, const Loads& loads, const SolverOptions& options, const Formulation& formulation);

  /// As Dynamics::advance. Newton's iterations end at a residual of 1e-11 of the forces, or at round-off; a step that they do not solve is
  /// halved. @throws std::runtime_error when a sixty-fourth of a step is not solved either
  Vector advance(Motion& motion, const Vector& mean_force, double length, int steps, Energy* energy = nullptr);

  /// Energies of a motion, kinetic and strain [J].
  Energy energy(const Motion& motion) const;

  std::size_t factorisations() const { return factorisations_; }

 private:
  /// What the steps of a window gave, summed.
  struct Sum {
    Vector impulse;  ///< of supports at held unknowns [N s]
    double work = 0, support_work = 0, damping = 0;  ///< [J]
  };
  void take(Motion& motion, const Vector& mean_force, double step, int halvings, Sum& sum);
  bool solve(const Motion& motion, const Vector& load, double step, Motion& end, Sum& sum);

  const Mesh& mesh_;
  const Materials& materials_;
  const MassMatrix& mass_;
  Rayleigh damping_;
  const Supports& supports_;
  const Loads& loads_;
  SolverOptions options_;
  Formulation formulation_;
  std::size_t factorisations_ = 0;
};

}  // namespace acopla::fem
