#include "fem/large_motion.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "fem/finite_strain.h"
#include "io/error.h"

namespace acopla::fem {
namespace {

/// Residual of a step, relative to the largest of its forces.
constexpr double converged = 1e-11;
/// Change of the displacements, relative to that of the step, below which an iteration has nothing left to do.
constexpr double smallest_change = 1e-11;
/// Of a residual that no longer falls: round-off of membrane forces that cancel.
constexpr double round_off = 1e-7;
constexpr int most_iterations = 30;
/// A factor serves until the residual falls by less than this an iteration.
constexpr double slow = 0.2;
constexpr int most_halvings = 6;

}  // namespace

LargeMotion::LargeMotion(const Mesh& mesh, const Materials& materials, const MassMatrix& mass, const Rayleigh& damping,
                         const Supports& supports, const Loads& loads, const SolverOptions& options, const Formulation& formulation)
    : mesh_(mesh),
      materials_(materials),
      mass_(mass),
      damping_(damping),
      supports_(supports),
      loads_(loads),
      options_(options),
      formulation_(formulation) {}

/// For u₁ with v₁ = 2 (u₁ − u₀)/Δt − v₀; held unknowns bring both. The system is twice the equation, as in Dynamics.
/// @return false when the iterations do not get there
bool LargeMotion::solve(const Motion& start, const Vector& load, double step, Motion& end, Sum& sum) {
  const auto& fixed = supports_.fixed();
  const Vector &u0 = start.displacement, &v0 = start.velocity;
  auto &u1 = end.displacement, &v1 = end.velocity;
  end.time = start.time + step;
  u1 = u0 + step * v0;
  supports_.place(end.time, u1);
  BlockMatrix tangent(mass_.pattern(), mesh_.dimension());
  std::unique_ptr<BlockMatrix> matrix;
  ChosenSolver solver;
  Vector momentum, residual, change;
  const auto norm_of_free = [&](const Vector& v) {
    double square = 0;
    for (Eigen::Index i = 0; i < v.size(); ++i)
      if (!fixed[static_cast<std::size_t>(i)]) square += v[i] * v[i];
    return std::sqrt(square);
  };
  double before = HUGE_VAL;
  bool stale = true, still = false;
  for (int iteration = 0; iteration < most_iterations; ++iteration) {
    v1 = 2 / step * (u1 - u0) - v0;
    supports_.drive(end.time, v1);
    // The equation at all unknowns; at held ones the force of the supports.
    const auto evaluate = [&](BlockMatrix* into) {
      auto force = step_force(mesh_, materials_, formulation_, u0, u1, damping_.stiffness / step, into);
      mass_.multiply((v1 - v0) / step + damping_.mass / step * (u1 - u0), momentum);
      residual = load - force.internal - momentum;
      return force;
    };
    auto force = evaluate(stale ? &tangent : nullptr);
    double norm = norm_of_free(residual);
    if (!std::isfinite(norm)) return false;
    const double scale = std::max({norm_of_free(load), norm_of_free(force.internal), norm_of_free(momentum)});
    if (still || norm <= converged * scale || (norm > 0.9 * before && norm <= round_off * scale)) {
      for (Eigen::Index i = 0; i < residual.size(); ++i)
        if (!fixed[static_cast<std::size_t>(i)]) residual[i] = 0;
      sum.impulse -= step * residual;
      sum.work += load.dot(u1 - u0);
      if (supports_.moving()) sum.support_work -= residual.dot(u1 - u0);
      sum.damping += force.dissipation;
      if (damping_.mass != 0) {
        mass_.multiply(u1 - u0, momentum);
        sum.damping += damping_.mass / step * momentum.dot(u1 - u0);
      }
      return true;
    }
    if (norm > slow * before && !stale) {
      stale = true;
      evaluate(&tangent);
    }
    before = norm;
    if (stale) {
      solver = {};  // before its matrix goes
      matrix = std::make_unique<BlockMatrix>(combine(1, tangent, 4 / (step * step) + 2 / step * damping_.mass, mass_));
      try {
        solver = choose_solver(*matrix, mesh_, fixed, options_);
        solver.solver->prepare();
      } catch (const io::UserError&) {
        return false;  // not positive definite: too far
      }
      ++factorisations_;
      stale = false;
    }
    change.resize(0);
    solver.solver->solve(2 * residual, change);
    u1 += change;
    still = change.norm() <= smallest_change * (u1 - u0).norm();
  }
  return false;
}

void LargeMotion::take(Motion& motion, const Vector& mean_force, double step, int halvings, Sum& sum) {
  Motion end;
  if (solve(motion, mean_force + loads_.mean(motion.time, motion.time + step), step, end, sum)) {
    motion = std::move(end);
    return;
  }
  if (halvings == most_halvings)
    throw std::runtime_error(fmt::format("the motion at t = {:.6g} s finds no solution, not in a step of {:.3g} s either. Its cells may be turned "
                                         "inside out: use law = \"neo_hooke\" where strains are large, a shorter step, or look at the load.",
                                         motion.time, step));
  take(motion, mean_force, step / 2, halvings + 1, sum);
  take(motion, mean_force, step / 2, halvings + 1, sum);
}

Vector LargeMotion::advance(Motion& motion, const Vector& mean_force, double length, int steps, Energy* energy) {
  const double start = motion.time;
  Sum sum{.impulse = mesh_.zero()};
  for (int k = 0; k < steps; ++k) {
    motion.time = start + k * (length / steps);  // no sum of rounded steps
    take(motion, mean_force, length / steps, 0, sum);
  }
  motion.time = start + length;
  if (energy) {
    *energy = this->energy(motion);
    energy->work = sum.work;
    energy->support_work = sum.support_work;
    energy->damping = sum.damping;
  }
  return sum.impulse / length;
}

Energy LargeMotion::energy(const Motion& motion) const {
  Vector product;
  mass_.multiply(motion.velocity, product);
  return {.kinetic = 0.5 * motion.velocity.dot(product),
          .strain = strain_energy(mesh_, materials_, formulation_, motion.displacement)};
}

}  // namespace acopla::fem
