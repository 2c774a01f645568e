#include "dem/stability.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numeric>

namespace acopla::dem {

StabilityEstimate::StabilityEstimate(const Particles& particles, double step)
    : particles_(particles), step_(step), place_(particles.size(), ~0u) {}

void StabilityEstimate::add_pair(std::uint32_t i, std::uint32_t j, double overlap, const Kernel& kernel) {
  const double r_i = particles_.radius_of(i), r_j = particles_.radius_of(j), m_i = particles_.mass_of(i), m_j = particles_.mass_of(j);
  const double at_i = particles_.inertia_of(i) + m_i * r_i * r_i, at_j = particles_.inertia_of(j) + m_j * r_j * r_j;
  const auto contact = kernel.stiffness(overlap, r_i * r_j / (r_i + r_j), m_i * m_j / (m_i + m_j), at_i * at_j / (at_i + at_j));
  const Vec3 normal = (particles_.position[i].vector() - particles_.position[j].vector()).normalized();
  add(i, normal, r_i - 0.5 * overlap, contact, 2);
  add(j, -normal, r_j - 0.5 * overlap, contact, 2);
  remember(i, j, normal, r_i - 0.5 * overlap, r_j - 0.5 * overlap, contact);
}

void StabilityEstimate::add_wall(std::uint32_t i, double overlap, const Vec3& normal, double curvature, const Kernel& kernel) {
  const double r = particles_.radius_of(i), m = particles_.mass_of(i);
  const auto contact = kernel.stiffness(overlap, r / (1 + r * curvature), m, particles_.inertia_of(i) + m * r * r);
  add(i, normal, r - overlap, contact, 1);
  remember(i, none, normal, r - overlap, 0, contact);
}

void StabilityEstimate::add(std::uint32_t i, const Vec3& normal, double arm, const ContactStiffness& contact, double bodies) {
  if (place_[i] == ~0u) {
    place_[i] = static_cast<std::uint32_t>(sums_.size());
    sums_.emplace_back();
    particle_.push_back(i);
  }
  auto& sums = sums_[place_[i]];
  // In coordinates scaled by the roots of mass and inertia. Slip of i's surface: u − n (n·u) − arm θ × n.
  const double per_mass = 1 / std::sqrt(particles_.mass_of(i)), per_inertia = 1 / std::sqrt(particles_.inertia_of(i));
  Eigen::Matrix<double, 1, 6> closing = Eigen::Matrix<double, 1, 6>::Zero();
  closing.head<3>() = per_mass * normal.transpose();
  Eigen::Matrix<double, 3, 6> slip, turn = Eigen::Matrix<double, 3, 6>::Zero();
  slip.leftCols<3>() = per_mass * (Eigen::Matrix3d::Identity() - normal * normal.transpose());
  Eigen::Matrix3d across;
  across << 0, -normal[2], normal[1], normal[2], 0, -normal[0], -normal[1], normal[0], 0;
  slip.rightCols<3>() = per_inertia * arm * across;
  turn.rightCols<3>() = per_inertia * Eigen::Matrix3d::Identity();
  if (particles_.kind.dimension == 2) {  // discs move in the plane and turn about its axis
    slip.col(2).setZero();
    slip.col(3).setZero();
    slip.col(4).setZero();
    turn.col(3).setZero();
    turn.col(4).setZero();
  }
  const double square = bodies * step_ * step_, twice = 2 * bodies * step_;
  sums.stiffness += square * contact.normal * closing.transpose() * closing;
  sums.dashpot += 2 * twice * contact.normal_dashpot * closing.transpose() * closing;
  if (contact.shear > 0) {
    sums.stiffness += square * contact.shear * slip.transpose() * slip;
    sums.dashpot += twice * contact.shear_dashpot * slip.transpose() * slip;
  }
  if (contact.rolling > 0) {
    sums.stiffness += square * contact.rolling * turn.transpose() * turn;
    sums.dashpot += twice * contact.rolling_dashpot * turn.transpose() * turn;
  }
}

StepRatio StabilityEstimate::bound() const {
  // The Frobenius norm bounds the largest eigenvalue: eigenvalues are needed only while a norm exceeds the largest found.
  std::vector<double> norm(sums_.size());
  std::vector<std::uint32_t> order(sums_.size());
  std::iota(order.begin(), order.end(), 0u);
  for (std::size_t k = 0; k < sums_.size(); ++k) norm[k] = (sums_[k].stiffness + sums_[k].dashpot).norm();
  std::sort(order.begin(), order.end(), [&](auto a, auto b) { return norm[a] > norm[b]; });
  double largest = 0;
  StepRatio worst;
  for (const auto k : order) {
    if (norm[k] <= largest) break;
    const Eigen::SelfAdjointEigenSolver<Block> solver(sums_[k].stiffness + sums_[k].dashpot);
    if (solver.eigenvalues()[5] <= largest) continue;
    largest = solver.eigenvalues()[5];
    // The limit is s Δt with s² a + s b = 4 along this eigenvector.
    const Eigen::Matrix<double, 6, 1> mode = solver.eigenvectors().col(5);
    const double a = mode.dot(sums_[k].stiffness * mode), b = mode.dot(sums_[k].dashpot * mode);
    worst = {(b + std::sqrt(b * b + 16 * a)) / 8, particle_[k]};
  }
  return worst;
}

void StabilityEstimate::remember(std::uint32_t i, std::uint32_t j, const Vec3& normal, double arm_i, double arm_j, const ContactStiffness& contact) {
  const double square = step_ * step_, twice = 2 * step_;
  contacts_.push_back({i, j, normal, arm_i, arm_j,
                       {square * contact.normal, square * contact.shear, square * contact.rolling},
                       {2 * twice * contact.normal_dashpot, twice * contact.shear_dashpot, twice * contact.rolling_dashpot}});
}

// result = M^-½ (stiffness · Δt² K + dashpot · 2 Δt (2 C_n + C_t)) M^-½ motion
void StabilityEstimate::apply(const Motion& motion, Motion& result, double stiffness, double dashpot) const {
  result.setZero();
  const bool plane = particles_.kind.dimension == 2;
  for (const auto& c : contacts_) {
    const auto velocity = [&](std::uint32_t i) { return Vec3(motion.col(i).head<3>() / std::sqrt(particles_.mass_of(i))); };
    const auto spin = [&](std::uint32_t i) { return Vec3(motion.col(i).tail<3>() / std::sqrt(particles_.inertia_of(i))); };
    Vec3 relative = velocity(c.i), turn = spin(c.i), arms = c.arm_i * spin(c.i);
    if (c.j != none) {
      relative -= velocity(c.j);
      turn -= spin(c.j);
      arms += c.arm_j * spin(c.j);
    }
    const double closing = relative.dot(c.normal);
    const Vec3 slip = relative - closing * c.normal - arms.cross(c.normal);
    const auto rate = [&](int kind) { return stiffness * c.stiffness[kind] + dashpot * c.dashpot[kind]; };
    const Vec3 shear = rate(1) * slip, force = rate(0) * closing * c.normal + shear, rolling = rate(2) * turn;
    const Vec3 turning = -c.normal.cross(shear);
    const auto add = [&](std::uint32_t i, const Vec3& on, const Vec3& torque) {
      result.col(i).head<3>() += on / std::sqrt(particles_.mass_of(i));
      result.col(i).tail<3>() += torque / std::sqrt(particles_.inertia_of(i));
    };
    add(c.i, force, c.arm_i * turning + rolling);
    if (c.j != none) add(c.j, -force, c.arm_j * turning - rolling);
  }
  if (plane) {
    result.row(2).setZero();
    result.middleRows<2>(3).setZero();
  }
}

StepRatio StabilityEstimate::limit() const {
  const auto worst = bound();
  if (worst.value == 0) return worst;
  const auto count = static_cast<Eigen::Index>(particles_.size());
  // Begins near the particle of the bound; a little of everything else keeps other modes within reach.
  Motion mode(6, count), next(6, count);
  for (Eigen::Index i = 0; i < count; ++i)
    for (Eigen::Index d = 0; d < 6; ++d) mode(d, i) = 1e-3 * std::sin(1.0 + 12.9898 * static_cast<double>(i) + 78.233 * static_cast<double>(d));
  mode.col(static_cast<Eigen::Index>(worst.particle)) += Eigen::Matrix<double, 6, 1>::Ones();
  double largest = 0;
  for (int iteration = 0; iteration < 200; ++iteration) {
    mode /= mode.norm();
    apply(mode, next, 1, 1);
    const double value = mode.cwiseProduct(next).sum();
    const bool settled = iteration > 20 && value < largest * (1 + 1e-3);
    largest = std::max(largest, value);
    mode.swap(next);
    if (settled) break;
  }
  mode /= mode.norm();
  apply(mode, next, 1, 0);
  const double a = mode.cwiseProduct(next).sum();
  apply(mode, next, 0, 1);
  const double b = mode.cwiseProduct(next).sum();
  Eigen::Index moves = 0;
  mode.colwise().squaredNorm().maxCoeff(&moves);
  return {(b + std::sqrt(b * b + 16 * a)) / 8, static_cast<std::size_t>(moves)};
}

}  // namespace acopla::dem
