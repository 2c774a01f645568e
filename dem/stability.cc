#include "dem/stability.h"

#include <Eigen/Eigenvalues>
#include <cmath>

namespace acopla::dem {

StabilityEstimate::StabilityEstimate(const Particles& particles) : particles_(particles), sums_(particles.size()) {}

void StabilityEstimate::add_pair(std::uint32_t i, std::uint32_t j, double overlap, const Kernel& kernel) {
  const double r_i = particles_.radius_of(i), r_j = particles_.radius_of(j), m_i = particles_.mass_of(i), m_j = particles_.mass_of(j);
  const double at_i = particles_.inertia_of(i) + m_i * r_i * r_i, at_j = particles_.inertia_of(j) + m_j * r_j * r_j;
  const auto contact = kernel.stiffness(overlap, r_i * r_j / (r_i + r_j), m_i * m_j / (m_i + m_j), at_i * at_j / (at_i + at_j));
  const Vec3 normal = (particles_.position[i].vector() - particles_.position[j].vector()).normalized();
  add(i, normal, contact, 2);
  add(j, normal, contact, 2);
}

void StabilityEstimate::add_wall(std::uint32_t i, double overlap, const Vec3& normal, double curvature, const Kernel& kernel) {
  const double r = particles_.radius_of(i), m = particles_.mass_of(i);
  add(i, normal, kernel.stiffness(overlap, r / (1 + r * curvature), m, particles_.inertia_of(i) + m * r * r), 1);
}

void StabilityEstimate::add(std::uint32_t i, const Vec3& normal, const ContactStiffness& contact, double bodies) {
  auto& sums = sums_[i];
  const double turning = 1 + (particles_.kind.dimension == 2 ? 2.0 : 2.5);  // 1 + m r²/I
  const Eigen::Matrix3d along = normal * normal.transpose();
  Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - along;
  if (particles_.kind.dimension == 2) across(2, 2) = 0;
  sums.stiffness += bodies * (contact.normal * along + turning * contact.shear * across);
  sums.dashpot += bodies * (contact.normal_dashpot * along + turning * contact.shear_dashpot * across);
  sums.rolling += bodies * contact.rolling;
  sums.rolling_dashpot += bodies * contact.rolling_dashpot;
  sums.touched = true;
}

StepRatio StabilityEstimate::worst(double step) const {
  StepRatio worst;
  for (std::size_t i = 0; i < sums_.size(); ++i) {
    if (!sums_[i].touched) continue;
    const double mass = particles_.mass_of(i), inertia = particles_.inertia_of(i);
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
    const auto largest = [&](const Eigen::Matrix3d& matrix) { return solver.computeDirect(matrix, Eigen::EigenvaluesOnly).eigenvalues()[2]; };
    const double square = largest(sums_[i].stiffness) / mass + sums_[i].rolling / inertia;
    if (!(square > 0)) continue;
    const double omega = std::sqrt(square);
    const double zeta = (largest(sums_[i].dashpot) / mass + sums_[i].rolling_dashpot / inertia) / (2 * omega);
    const double ratio = step * omega / (2 * (std::sqrt(1 + zeta * zeta) - zeta));
    if (ratio > worst.value) worst = {ratio, i};
  }
  return worst;
}

}  // namespace acopla::dem
