// A structure in motion: M a + C v + K u = f with C = c_a M + c_b K, step by step.
#pragma once

#include <memory>
#include <optional>

#include "fem/block_matrix.h"
#include "fem/linear_solver.h"
#include "fem/loads.h"
#include "fem/matrices.h"
#include "fem/supports.h"

namespace acopla::fem {

/// C = mass · M + stiffness · K (Rayleigh); a mode of angular frequency ω has the damping ratio
/// mass / (2 ω) + stiffness ω / 2.
struct Rayleigh {
  double mass = 0;       ///< c_a [1/s]
  double stiffness = 0;  ///< c_b [s]
};

/// How a step is taken: Newmark (1959) with β and γ, or with α_m, α_f too the generalised-α method
/// (Chung & Hulbert 1993).
struct Scheme {
  double beta = 0.25, gamma = 0.5;
  double alpha_m = 0, alpha_f = 0;
  bool generalised = false;

  /// @throws std::invalid_argument unless 2 β ≥ γ ≥ 1/2, where Newmark's method is stable at every
  /// step; its text continues the name of the table
  static Scheme newmark(double beta, double gamma);
  /// @param spectral_radius  of the highest frequencies, in [0, 1]
  static Scheme generalised_alpha(double spectral_radius);
  /// β = 1/4, γ = 1/2: the trapezoidal rule, which needs no acceleration at all when the load is
  /// constant over a step.
  bool average_acceleration() const { return !generalised && beta == 0.25 && gamma == 0.5; }
};

/// What a step begins with and ends in.
struct Motion {
  Vector displacement;  ///< u [m]
  Vector velocity;      ///< v [m/s]
  Vector acceleration;  ///< a [m/s²]; kept by the generalised-α method only
  Vector force;         ///< the received load of the window before [N]; the same
  double time = 0;      ///< [s]

  template <class Archive>
  void state(Archive& archive) {
    archive("displacement", displacement);
    archive("velocity", velocity);
    archive("acceleration", acceleration);
    archive("force", force);
    archive("time", time);
  }
};

/// Energies at the end of a window and what passed in it [J].
struct Energy {
  double kinetic = 0;       ///< ½ vᵀ M v at the end
  double strain = 0;        ///< ½ uᵀ K u at the end
  double work = 0;          ///< of the loads, in the window
  double support_work = 0;  ///< of supports that move, in the window
  double damping = 0;       ///< lost to C, in the window
};

/// Linear dynamics of one body. Everything given must outlive it.
class Dynamics {
 public:
  Dynamics(const Mesh& mesh, const BlockMatrix& stiffness, const MassMatrix& mass,
           const Rayleigh& damping, const Supports& supports, const Loads& loads,
           const Scheme& scheme, const SolverOptions& options);
  /// The same on matrices wherever they are.
  Dynamics(const Mesh& mesh, std::shared_ptr<const Matrices> matrices, const Rayleigh& damping, const Supports& supports,
           const Loads& loads, const Scheme& scheme, const SolverOptions& options);

  /// Analyses and factors the effective matrix of this step [s], unless it is the one before; the
  /// mass too where the scheme needs accelerations. @throws as LinearSolver::prepare
  void prepare(double step);

  /// Takes `steps` equal steps of a window under the mean F̄ of the received load over it [N] and
  /// the structure's own loads.
  ///
  /// F̄ is an impulse: it is constant over the window, and the acceleration at the window's start is
  /// that of F̄, from M a = F̄ − K u − C v. With β = 1/4, γ = 1/2 this is the midpoint rule
  ///   M (v₁ − v₀)/Δt + C (u₁ − u₀)/Δt + K (u₀ + u₁)/2 = F̄,  (u₁ − u₀)/Δt = (v₀ + v₁)/2.
  /// The generalised-α method keeps its own acceleration, which is not that of the equation of
  /// motion at t: it is changed by M⁻¹ (F̄ − F̄ before), the jump of the load. Made from the equation
  /// of motion instead, it would lose an order.
  /// @return reactions [N], the mean over the window of the force of the supports, at held nodes (0
  /// elsewhere)
  Vector advance(Motion& motion, const Vector& mean_force, double length, int steps,
                 Energy* energy = nullptr);

  /// Energies of a motion, kinetic and strain [J].
  Energy energy(const Motion& motion) const;

  double condition() const;  ///< κ of the effective matrix at free unknowns, after prepare()
  const ChosenSolver& solver() const { return effective_; }
  std::size_t factorisations() const { return factorisations_; }

 private:
  void begin(Motion& motion, const Vector& mean_force);
  void midpoint_step(Motion& motion, const Vector& mean_force, double step);
  void newmark_step(Motion& motion, const Vector& mean_force, double step);
  Vector reactions(const Vector& u0, const Vector& v0, const Vector& mean_u, const Motion& end,
                   const Vector& load, double length) const;
  void add_exchange(const Vector& u0, const Vector& v0, const Motion& end, const Vector& mean_force,
                    double step, Energy& energy) const;

  const Mesh& mesh_;
  std::shared_ptr<const Matrices> matrices_;
  Rayleigh damping_;
  const Supports& supports_;
  const Loads& loads_;
  Scheme scheme_;
  SolverOptions options_;
  std::vector<std::uint32_t> held_nodes_;
  double step_ = 0;
  double of_stiffness_ = 0, of_mass_ = 0;  // the effective matrix is that much of each
  ChosenSolver effective_, mass_solver_;
  std::size_t factorisations_ = 0;
  Vector K_arg_, M_arg_, K_x_, M_x_, right_, change_, held_,
      speed_;  // of a step, kept so that few are allocated in it
};

}  // namespace acopla::fem
