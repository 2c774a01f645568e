#include "fem/stress.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "fem/hyperelastic.h"

namespace acopla::fem {

double von_mises(const StressVector& s) {
  const double normal =
      (s[0] - s[1]) * (s[0] - s[1]) + (s[1] - s[2]) * (s[1] - s[2]) + (s[2] - s[0]) * (s[2] - s[0]);
  return std::sqrt(0.5 * normal + 3 * s.tail<3>().squaredNorm());
}

Vec3 principal(const StressVector& s) {
  Eigen::Matrix3d tensor;
  tensor << s[0], s[5], s[4], s[5], s[1], s[3], s[4], s[3], s[2];
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(tensor, Eigen::EigenvaluesOnly);
  return solver.eigenvalues().reverse();
}

Stress::Stress(const Mesh& mesh, Materials materials, const Formulation& formulation)
    : mesh_(mesh), materials_(std::move(materials)), formulation_(formulation) {
  const auto& table = mesh.element().stress;
  with_dimension(mesh.dimension(), [&](auto d) {
    inverse_jacobians_.reserve(mesh.cells() * table.points() * d * d);
    for (std::size_t c = 0; c < mesh.cells(); ++c) {
      const auto x = mesh.positions<d>(c);
      for (const auto& gradients : table.gradients) {
        const Eigen::Matrix<double, d, d> J = x * gradients, inverse = J.inverse();
        inverse_jacobians_.insert(inverse_jacobians_.end(), inverse.data(), inverse.data() + d * d);
      }
    }
  });
}

namespace {

/// σ = F S Fᵀ / det F. @param thin  plane stress of a St. Venant–Kirchhoff solid: F_zz follows from S_zz = 0
StressVector cauchy(const Eigen::Matrix3d& slope, double lambda, const Material& material, bool thin) {
  Eigen::Matrix3d F = Eigen::Matrix3d::Identity() + slope;
  Eigen::Matrix3d S = respond<3>(material, lambda, F).S;
  if (thin) {
    const double strain = 0.5 * ((F.transpose() * F).trace() - 3), mu = material.mu();
    S(2, 2) = 0;
    // The λ' = 2 λ μ / (λ + 2 μ) of plane stress: E_zz = −λ'/(2 μ) tr E.
    F(2, 2) = std::sqrt(std::max(1e-12, 1 - lambda / mu * strain));
  }
  const Eigen::Matrix3d sigma = F * S * F.transpose() / F.determinant();
  StressVector result;
  result << sigma(0, 0), sigma(1, 1), sigma(2, 2), sigma(1, 2), sigma(0, 2), sigma(0, 1);
  return result;
}

}  // namespace

/// B-bar's volumetric strain at the stress points: the cell's own, projected as in the stiffness.
template <int d>
Eigen::VectorXd Stress::projected_divergence(
    std::size_t cell, const Eigen::Matrix<double, d, Eigen::Dynamic>& moved) const {
  const auto& element = mesh_.element();
  const auto& table = element.stiffness;
  const auto x = mesh_.positions<d>(cell);
  const Eigen::MatrixXd psi = element.volumetric(table);
  Eigen::VectorXd weights(psi.cols()), divergence(psi.cols());
  for (int q = 0; q < psi.cols(); ++q) {
    const Eigen::Matrix<double, d, d> J = x * table.gradients[static_cast<std::size_t>(q)];
    const Eigen::Matrix<double, d, d> slope =
        moved * table.gradients[static_cast<std::size_t>(q)] * J.inverse();
    weights[q] = table.weights[q] * J.determinant();
    divergence[q] = slope.trace();
  }
  const Eigen::MatrixXd Kv = psi * weights.asDiagonal() * psi.transpose();
  const Eigen::VectorXd coefficients = Kv.ldlt().solve(psi * weights.cwiseProduct(divergence));
  return element.volumetric(element.stress).transpose() * coefficients;
}

template <int d>
Eigen::Matrix<double, 6, Eigen::Dynamic> Stress::stress(std::size_t cell, const Vector& u) const {
  const auto& table = mesh_.element().stress;
  const auto nodes = mesh_.cell(cell);
  Eigen::Matrix<double, d, Eigen::Dynamic> moved(d, std::ssize(nodes));
  for (std::size_t a = 0; a < nodes.size(); ++a)
    moved.col(static_cast<int>(a)) = u.segment<d>(d * Eigen::Index{nodes[a]});
  const auto& material = materials_.of(cell);
  const double mu = material.mu(), lambda = formulation_.lambda(material, d);
  const bool b_bar = formulation_.locking == Formulation::Locking::b_bar;
  const Eigen::VectorXd averaged = b_bar ? projected_divergence<d>(cell, moved) : Eigen::VectorXd();
  Eigen::Matrix<double, 6, Eigen::Dynamic> result(6, std::ssize(table.gradients));
  for (std::size_t q = 0; q < table.points(); ++q) {
    const Eigen::Map<const Eigen::Matrix<double, d, d>> inverse(
        inverse_jacobians_.data() + (cell * table.points() + q) * d * d);
    Eigen::Matrix3d slope = Eigen::Matrix3d::Zero();
    slope.topLeftCorner<d, d>() = (moved * table.gradients[q]) * inverse;
    if (formulation_.large) {
      result.col(static_cast<int>(q)) =
          cauchy(slope, lambda, material, d == 2 && formulation_.plane == Formulation::Plane::stress);
      continue;
    }
    const double volumetric =
        b_bar ? (material.lambda() + 2 * mu / 3) * averaged[static_cast<int>(q)] -
                    2 * mu / 3 * slope.trace()
              : lambda * slope.trace();
    const bool free_across = d == 2 && formulation_.plane == Formulation::Plane::stress;
    result.col(static_cast<int>(q)) << volumetric + 2 * mu * slope(0, 0),
        volumetric + 2 * mu * slope(1, 1), free_across ? 0.0 : volumetric + 2 * mu * slope(2, 2),
        mu * (slope(1, 2) + slope(2, 1)), mu * (slope(0, 2) + slope(2, 0)),
        mu * (slope(0, 1) + slope(1, 0));
  }
  return result;
}

Eigen::Matrix<double, 6, Eigen::Dynamic> Stress::at_points(std::size_t cell,
                                                           const Vector& u) const {
  return mesh_.dimension() == 2 ? stress<2>(cell, u) : stress<3>(cell, u);
}

Peak Stress::peak(const Vector& u) const {
  Peak peak;
  std::size_t at_cell = 0;
  int at_point = 0;
  for (std::size_t c = 0; c < mesh_.cells(); ++c) {
    const auto stress = at_points(c, u);
    for (int q = 0; q < stress.cols(); ++q) {
      const double value = von_mises(stress.col(q));
      if (!(value > peak.value)) continue;
      peak.value = value;
      at_cell = c;
      at_point = q;
    }
  }
  peak.where = mesh_.positions(at_cell) * mesh_.element().stress.values.col(at_point);
  return peak;
}

Eigen::Matrix<double, 6, Eigen::Dynamic> Stress::nodal(const Vector& u) const {
  const auto count = static_cast<Eigen::Index>(mesh_.nodes());
  Eigen::Matrix<double, 6, Eigen::Dynamic> sum =
      Eigen::Matrix<double, 6, Eigen::Dynamic>::Zero(6, count);
  Vector cells = Vector::Zero(count);
  const Eigen::MatrixXd fit = mesh_.element().extrapolation.transpose();
  for (std::size_t c = 0; c < mesh_.cells(); ++c) {
    const Eigen::Matrix<double, 6, Eigen::Dynamic> at_nodes = at_points(c, u) * fit;
    const auto nodes = mesh_.cell(c);
    for (std::size_t a = 0; a < nodes.size(); ++a) {
      sum.col(nodes[a]) += at_nodes.col(static_cast<int>(a));
      cells[nodes[a]] += 1;
    }
  }
  for (Eigen::Index n = 0; n < count; ++n) sum.col(n) /= std::max(1.0, cells[n]);
  return sum;
}

StressVector Stress::at_node(std::uint32_t node, const std::vector<std::size_t>& cells,
                             const Vector& u) const {
  StressVector sum = StressVector::Zero();
  for (const auto c : cells) {
    const auto nodes = mesh_.cell(c);
    const auto a = std::find(nodes.begin(), nodes.end(), node) - nodes.begin();
    sum += at_points(c, u) * mesh_.element().extrapolation.row(a).transpose();
  }
  return sum / std::max(1.0, static_cast<double>(cells.size()));
}

Vector Stress::nodal_von_mises(const Vector& u) const {
  const auto stresses = nodal(u);
  Vector result(stresses.cols());
  for (Eigen::Index n = 0; n < result.size(); ++n) result[n] = von_mises(stresses.col(n));
  return result;
}

}  // namespace acopla::fem
