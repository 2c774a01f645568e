#include "fem/statics.h"

#include <algorithm>
#include <cmath>

namespace acopla::fem {
namespace {

/// Above this the back-substitution has lost digits that one step of iterative refinement restores
/// (Skeel 1980); below, the error is that of rounding the displacements.
constexpr double sound_backward_error = 1e-14;

}  // namespace

Vec3 total(const Vector& nodal) { return nodal.reshaped(3, nodal.size() / 3).rowwise().sum(); }

Vec3 StaticSolution::total_reaction() const { return total(reaction); }

Statics::Statics(const Mesh& mesh, const Material& material, const Fixed& fixed,
                 const SolverOptions& options)
    : fixed_(fixed),
      stiffness_(assemble_stiffness(mesh, material)),
      norm_(stiffness_.norm()),
      chosen_(choose_solver(stiffness_, mesh, fixed, options)) {}

double Statics::free_residual(const Vector& residual) const {
  double largest = 0;
  for (std::size_t i = 0; i < fixed_.size(); ++i)
    if (!fixed_[i]) largest = std::max(largest, std::abs(residual[static_cast<Eigen::Index>(i)]));
  return largest;
}

StaticSolution Statics::solve(const Vector& load, const Vector& guess) const {
  StaticSolution result;
  result.displacement = guess;
  chosen_.solver->solve(load, result.displacement);
  const auto backward_error = [&] {
    stiffness_.multiply(result.displacement, result.reaction);
    result.reaction -= load;
    const double scale =
        norm_ * result.displacement.lpNorm<Eigen::Infinity>() + load.lpNorm<Eigen::Infinity>();
    return scale > 0 ? free_residual(result.reaction) / scale : 0.0;
  };
  result.residual = backward_error();
  if (chosen_.direct && result.residual > sound_backward_error) {
    Vector correction;
    chosen_.solver->solve(result.reaction, correction);
    result.displacement -= correction;
    result.residual = backward_error();
  }
  for (std::size_t i = 0; i < fixed_.size(); ++i)
    if (!fixed_[i]) result.reaction[static_cast<Eigen::Index>(i)] = 0;
  return result;
}

}  // namespace acopla::fem
