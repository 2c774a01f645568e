#include "fem/stress.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace acopla::fem {

double von_mises(const StressVector& s) {
  const double normal =
      (s[0] - s[1]) * (s[0] - s[1]) + (s[1] - s[2]) * (s[1] - s[2]) + (s[2] - s[0]) * (s[2] - s[0]);
  return std::sqrt(0.5 * normal + 3 * s.tail<3>().squaredNorm());
}

Stress::Stress(const Mesh& mesh, const Material& material)
    : mesh_(mesh), lambda_(material.lambda()), mu_(material.mu()) {
  const auto& table = mesh.element().stress;
  inverse_jacobians_.reserve(mesh.cells() * table.points());
  for (std::size_t c = 0; c < mesh.cells(); ++c) {
    const auto x = mesh.positions(c);
    for (const auto& gradients : table.gradients)
      inverse_jacobians_.push_back(jacobian(x, gradients).inverse());
  }
}

Eigen::Matrix<double, 6, Eigen::Dynamic> Stress::at_points(std::size_t cell,
                                                           const Vector& u) const {
  const auto& table = mesh_.element().stress;
  const auto nodes = mesh_.cell(cell);
  Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::ColMajor, 3, 27> moved(3, std::ssize(nodes));
  for (std::size_t a = 0; a < nodes.size(); ++a)
    moved.col(static_cast<int>(a)) = u.segment<3>(3 * Eigen::Index{nodes[a]});
  Eigen::Matrix<double, 6, Eigen::Dynamic> result(6, std::ssize(table.gradients));
  for (std::size_t q = 0; q < table.points(); ++q) {
    const Eigen::Matrix3d slope =
        (moved * table.gradients[q]) * inverse_jacobians_[cell * table.points() + q];
    const double volumetric = lambda_ * slope.trace();
    result.col(static_cast<int>(q)) << volumetric + 2 * mu_ * slope(0, 0),
        volumetric + 2 * mu_ * slope(1, 1), volumetric + 2 * mu_ * slope(2, 2),
        mu_ * (slope(1, 2) + slope(2, 1)), mu_ * (slope(0, 2) + slope(2, 0)),
        mu_ * (slope(0, 1) + slope(1, 0));
  }
  return result;
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

Vector Stress::nodal_von_mises(const Vector& u) const {
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
  Vector result(count);
  for (Eigen::Index n = 0; n < count; ++n)
    result[n] = von_mises(sum.col(n) / std::max(1.0, cells[n]));
  return result;
}

}  // namespace acopla::fem
