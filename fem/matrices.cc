#include "fem/matrices.h"

namespace acopla::fem {

ChosenSolver LocalMatrices::solver(double k, double m, const SolverOptions& options) const {
  if (k == 1 && m == 0) return choose_solver(stiffness_, mesh_, fixed_, options);
  const auto matrix = std::make_shared<const BlockMatrix>(combine(k, stiffness_, m, *mass_));
  auto chosen = choose_solver(*matrix, mesh_, fixed_, options);
  chosen.matrix = matrix;
  return chosen;
}

std::vector<double> LocalMatrices::sudden(std::span<const std::uint32_t> nodes) const {
  std::vector<double> result;
  for (const auto node : nodes) result.push_back(mass_->sudden(node));
  return result;
}

}  // namespace acopla::fem
