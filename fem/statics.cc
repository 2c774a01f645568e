#include "fem/statics.h"

#include <algorithm>
#include <cmath>

#include "fem/condition.h"

namespace acopla::fem {
namespace {

/// Above this the back-substitution has lost digits that one step of iterative refinement restores
/// (Skeel 1980); below, the error is that of rounding the displacements.
constexpr double sound_backward_error = 1e-14;

}  // namespace

Statics::Statics(const Mesh& mesh, const Materials& materials, const Fixed& fixed,
                 const SolverOptions& options, const Formulation& formulation)
    : fixed_(fixed),
      own_(std::make_unique<BlockMatrix>(assemble_stiffness(mesh, materials, formulation))),
      matrices_(std::make_shared<LocalMatrices>(mesh, fixed, *own_)),
      norm_(matrices_->norm()),
      chosen_(matrices_->solver(1, 0, options)) {}

Statics::Statics(const Mesh& mesh, const BlockMatrix& stiffness, const Fixed& fixed,
                 const SolverOptions& options)
    : Statics(std::make_shared<LocalMatrices>(mesh, fixed, stiffness), fixed, options) {}

Statics::Statics(std::shared_ptr<const Matrices> matrices, const Fixed& fixed, const SolverOptions& options)
    : fixed_(fixed), matrices_(std::move(matrices)), norm_(matrices_->norm()), chosen_(matrices_->solver(1, 0, options)) {}

double Statics::condition() const {
  return condition_number([&](const Vector& x, Vector& result) { matrices_->stiffness(x, result); },
                          [&](const Vector& x, Vector& result) {
                            result.resize(0);
                            chosen_.solver->solve(x, result);
                          },
                          fixed_);
}

double Statics::free_residual(const Vector& residual) const {
  double largest = 0;
  for (std::size_t i = 0; i < fixed_.size(); ++i)
    if (!fixed_[i]) largest = std::max(largest, std::abs(residual[static_cast<Eigen::Index>(i)]));
  return largest;
}

StaticSolution Statics::solve(const Vector& load, const Vector& guess,
                              const Vector& prescribed) const {
  StaticSolution result;
  result.dimension = matrices_->dimension();
  result.displacement = guess;
  if (prescribed.size() == 0) {
    chosen_.solver->solve(load, result.displacement);
  } else {
    // u = u_p + w: K w = f − K u_p, with w = 0 at held unknowns.
    Vector held = Vector::Zero(load.size()), right;
    for (std::size_t i = 0; i < fixed_.size(); ++i)
      if (fixed_[i]) held[static_cast<Eigen::Index>(i)] = prescribed[static_cast<Eigen::Index>(i)];
    matrices_->stiffness(held, right);
    right = load - right;
    chosen_.solver->solve(right, result.displacement);
    result.displacement += held;
  }
  const auto backward_error = [&] {
    matrices_->stiffness(result.displacement, result.reaction);
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
