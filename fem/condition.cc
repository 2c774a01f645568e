#include "fem/condition.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <vector>

namespace acopla::fem {
namespace {

/// Largest eigenvalue of a symmetric positive map, from a start that no symmetry hides modes from. All vectors are orthogonalised anew,
/// so that no copies of eigenvalues appear.
double largest_eigenvalue(const LinearMap& map, const Fixed& fixed, int steps) {
  const auto size = static_cast<Eigen::Index>(fixed.size());
  Vector q(size), w;
  for (Eigen::Index i = 0; i < size; ++i)
    q[i] = fixed[static_cast<std::size_t>(i)] ? 0 : 1 + 0.5 * std::sin(1.7 * static_cast<double>(i + 1) * static_cast<double>(i % 13 + 1));
  if (q.squaredNorm() == 0) return 0;
  q.normalize();
  std::vector<Vector> basis;
  std::vector<double> diagonal, beside;
  for (int k = 0; k < steps; ++k) {
    basis.push_back(q);
    map(q, w);
    for (Eigen::Index i = 0; i < size; ++i)
      if (fixed[static_cast<std::size_t>(i)]) w[i] = 0;
    diagonal.push_back(q.dot(w));
    for (int twice = 0; twice < 2; ++twice)
      for (const auto& b : basis) w -= b.dot(w) * b;
    const double length = w.norm();
    if (!(length > 1e-12 * std::abs(diagonal.front()))) break;
    beside.push_back(length);
    q = w / length;
  }
  const auto count = std::ssize(diagonal);
  Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> tridiagonal;
  const Eigen::VectorXd a = Eigen::Map<const Eigen::VectorXd>(diagonal.data(), count);
  const Eigen::VectorXd b = Eigen::Map<const Eigen::VectorXd>(beside.data(), count - 1);
  return tridiagonal.computeFromTridiagonal(a, b, Eigen::EigenvaluesOnly).eigenvalues().maxCoeff();
}

}  // namespace

double condition_number(const LinearMap& multiply, const LinearMap& solve, const Fixed& fixed) {
  constexpr int products = 40, solutions = 12;  // the lowest modes lie apart, the highest close together
  return largest_eigenvalue(multiply, fixed, products) * largest_eigenvalue(solve, fixed, solutions);
}

}  // namespace acopla::fem
