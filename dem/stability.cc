#include "dem/stability.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numeric>

namespace acopla::dem {
namespace {

// Δt over s Δt, where s² a + s b + c = 4: what of a mode's eigenvalue grows with the step's square, with the step, and not at all.
double ratio_of(double a, double b, double c) {
  const double left = std::max(4 - c, 1e-3);
  return (b + std::sqrt(b * b + 4 * left * a)) / (2 * left);
}

}  // namespace

StabilityEstimate::StabilityEstimate(const Particles& particles, double step)
    : particles_(particles), step_(step), crude_(particles.size(), 0.0) {}

void StabilityEstimate::add_pair(std::uint32_t i, std::uint32_t j, double overlap, const Kernel& kernel) {
  const double r_i = particles_.radius_of(i), r_j = particles_.radius_of(j), m_i = particles_.mass_of(i), m_j = particles_.mass_of(j);
  const double I_i = particles_.inertia_of(i), I_j = particles_.inertia_of(j), at_i = I_i + m_i * r_i * r_i, at_j = I_j + m_j * r_j * r_j;
  const auto rates = kernel.stiffness(overlap, r_i * r_j / (r_i + r_j), m_i * m_j / (m_i + m_j), at_i * at_j / (at_i + at_j));
  const Vec3 normal = (particles_.position[i].vector() - particles_.position[j].vector()).normalized();
  add({i, j, normal, r_i - 0.5 * overlap, r_j - 0.5 * overlap, {}, {}, {}, {}}, rates, I_i * I_j / (I_i + I_j));
}

void StabilityEstimate::add_wall(std::uint32_t i, double overlap, const Vec3& normal, double curvature, const Kernel& kernel) {
  const double r = particles_.radius_of(i), m = particles_.mass_of(i), inertia = particles_.inertia_of(i);
  const auto rates = kernel.stiffness(overlap, r / (1 + r * curvature), m, inertia + m * r * r);
  add({i, none, normal, r - overlap, 0, {}, {}, {}, {}}, rates, inertia);
}

void StabilityEstimate::add(Contact contact, const ContactStiffness& rates, double reduced_inertia) {
  const double square = step_ * step_, twice = 2 * step_, fixed = 2 * rates.spin_share * reduced_inertia;
  contact.closing = {square * rates.normal, 2 * twice * rates.normal_dashpot, 0};
  contact.shear = {square * rates.shear, twice * rates.shear_dashpot, 0};
  contact.rolling = {square * rates.rolling, twice * rates.rolling_dashpot, fixed};
  contact.twisting = {rates.twisting * contact.rolling.stiffness, rates.twisting * contact.rolling.dashpot, fixed};
  contacts_.push_back(contact);
  const bool pair = contact.j != none;
  // A contact closes, or it slips and rolls: these motions are perpendicular.
  const Rates all{1, 1, 1};
  const double closing = contact.closing.at(all), shear = contact.shear.at(all), turning = std::max(contact.rolling.at(all), contact.twisting.at(all));
  const auto count = [&](std::uint32_t i, double arm, double bodies) {
    const double mass = particles_.mass_of(i), inertia = particles_.inertia_of(i);
    crude_[i] += bodies * std::max(closing / mass, shear / mass + (shear * arm * arm + turning) / inertia);
  };
  count(contact.i, contact.arm_i, pair ? 2 : 1);
  if (pair) count(contact.j, contact.arm_j, 2);
}

void StabilityEstimate::add_to(Sums& sums, std::uint32_t i, const Contact& contact) const {
  const bool first = contact.i == i;
  const Vec3 normal = first ? contact.normal : Vec3(-contact.normal);
  const double arm = first ? contact.arm_i : contact.arm_j, bodies = contact.j != none ? 2 : 1;
  // In coordinates scaled by the roots of mass and inertia. Slip of i's surface: u − n (n·u) − arm θ × n.
  const double per_mass = std::sqrt(bodies / particles_.mass_of(i)), per_inertia = std::sqrt(bodies / particles_.inertia_of(i));
  const bool plane = particles_.kind.dimension == 2;
  Eigen::Matrix<double, 1, 6> closing = Eigen::Matrix<double, 1, 6>::Zero(), twist = closing;
  closing.head<3>() = per_mass * normal.transpose();
  twist.tail<3>() = per_inertia * normal.transpose();
  const Eigen::Matrix3d tangent = Eigen::Matrix3d::Identity() - normal * normal.transpose();
  Eigen::Matrix<double, 3, 6> slip, roll = Eigen::Matrix<double, 3, 6>::Zero();
  slip.leftCols<3>() = per_mass * tangent;
  Eigen::Matrix3d across;
  across << 0, -normal[2], normal[1], normal[2], 0, -normal[0], -normal[1], normal[0], 0;
  slip.rightCols<3>() = per_inertia * arm * across;
  roll.rightCols<3>() = per_inertia * tangent;
  if (plane) {  // discs move in the plane and turn about its axis
    slip.middleCols<3>(2).setZero();
    roll.middleCols<2>(3).setZero();
    twist.setZero();
  }
  const auto include = [&](const auto& rate_of, const Rates& rates) {
    const Block square = rate_of.transpose() * rate_of;
    if (rates.stiffness > 0) sums.stiffness += rates.stiffness * square;
    if (rates.dashpot > 0) sums.dashpot += rates.dashpot * square;
    if (rates.fixed > 0) sums.fixed += rates.fixed * square;
  };
  include(closing, contact.closing);
  include(slip, contact.shear);
  include(roll, contact.rolling);
  include(twist, contact.twisting);
}

StepRatio StabilityEstimate::bound() const {
  // The contacts of every particle.
  std::vector<std::uint32_t> start(particles_.size() + 1, 0);
  const auto visit = [&](auto&& action) {
    for (std::uint32_t c = 0; c < contacts_.size(); ++c) {
      action(contacts_[c].i, c);
      if (contacts_[c].j != none) action(contacts_[c].j, c);
    }
  };
  visit([&](std::uint32_t i, std::uint32_t) { ++start[i + 1]; });
  std::partial_sum(start.begin(), start.end(), start.begin());
  std::vector<std::uint32_t> of(start.back()), next(start.begin(), start.end() - 1);
  visit([&](std::uint32_t i, std::uint32_t c) { of[next[i]++] = c; });
  // The crude bound adds up the contacts' eigenvalues, the Frobenius norm is nearer: eigenvalues are needed only while either exceeds the
  // largest found.
  std::vector<std::uint32_t> order(particles_.size());
  std::iota(order.begin(), order.end(), 0u);
  const auto less = [&](std::uint32_t a, std::uint32_t b) { return crude_[a] < crude_[b] || (crude_[a] == crude_[b] && a > b); };
  std::make_heap(order.begin(), order.end(), less);
  double largest = 0;
  StepRatio worst;
  for (auto end = order.end(); end != order.begin() && crude_[order.front()] > largest; --end) {
    std::pop_heap(order.begin(), end, less);
    const auto i = *(end - 1);
    Sums sums;
    for (auto k = start[i]; k < start[i + 1]; ++k) add_to(sums, i, contacts_[of[k]]);
    const Block all = sums.all();
    if (all.norm() <= largest) continue;
    const Eigen::SelfAdjointEigenSolver<Block> solver(all);
    if (solver.eigenvalues()[5] <= largest) continue;
    largest = solver.eigenvalues()[5];
    const Eigen::Matrix<double, 6, 1> mode = solver.eigenvectors().col(5);
    worst = {ratio_of(mode.dot(sums.stiffness * mode), mode.dot(sums.dashpot * mode), mode.dot(sums.fixed * mode)), i};
  }
  return worst;
}

// result = M^-½ (weighted sum of Δt² K, 2 Δt (2 C_n + C_t) and its fixed part) M^-½ motion
void StabilityEstimate::apply(const Motion& motion, Motion& result, const Rates& weights) const {
  result.setZero();
  // Of every particle 1/sqrt(mass) and 1/sqrt(inertia).
  if (roots_.empty())
    for (std::size_t i = 0; i < particles_.size(); ++i)
      roots_.push_back({1 / std::sqrt(particles_.mass_of(i)), 1 / std::sqrt(particles_.inertia_of(i))});
  const bool plane = particles_.kind.dimension == 2;
  for (const auto& c : contacts_) {
    const auto velocity = [&](std::uint32_t i) { return Vec3(roots_[i].mass * motion.col(i).head<3>()); };
    const auto spin = [&](std::uint32_t i) { return Vec3(roots_[i].inertia * motion.col(i).tail<3>()); };
    Vec3 relative = velocity(c.i), turn = spin(c.i), arms = c.arm_i * spin(c.i);
    if (c.j != none) {
      relative -= velocity(c.j);
      turn -= spin(c.j);
      arms += c.arm_j * spin(c.j);
    }
    const double closing = relative.dot(c.normal), twist = turn.dot(c.normal);
    const Vec3 slip = relative - closing * c.normal - arms.cross(c.normal);
    const Vec3 shear = c.shear.at(weights) * slip, force = c.closing.at(weights) * closing * c.normal + shear;
    const Vec3 rolling = c.rolling.at(weights) * (turn - twist * c.normal) + c.twisting.at(weights) * twist * c.normal;
    const Vec3 turning = -c.normal.cross(shear);
    const auto add = [&](std::uint32_t i, const Vec3& on, const Vec3& torque) {
      result.col(i).head<3>() += roots_[i].mass * on;
      result.col(i).tail<3>() += roots_[i].inertia * torque;
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
  const Rates all{1, 1, 1};
  // Begins near the particle of the bound; a little of everything else keeps other modes within reach.
  Motion mode(6, count), image(6, count);
  for (Eigen::Index i = 0; i < count; ++i)
    for (Eigen::Index d = 0; d < 6; ++d) mode(d, i) = 1e-2 * std::sin(1.0 + 12.9898 * static_cast<double>(i) + 78.233 * static_cast<double>(d));
  mode.col(static_cast<Eigen::Index>(worst.particle)) += Eigen::Matrix<double, 6, 1>::Ones();
  if (particles_.kind.dimension == 2) {
    mode.row(2).setZero();
    mode.middleRows<2>(3).setZero();
  }
  mode /= mode.norm();
  apply(mode, image, all);
  // The largest eigenvalue by conjugate directions (Knyazev 2001): the best of the mode, its residual and the last direction.
  Motion residual, residual_image(6, count), direction, direction_image;
  const auto dot = [](const Motion& a, const Motion& b) { return a.cwiseProduct(b).sum(); };
  for (int iteration = 0; iteration < 200; ++iteration) {
    const double value = dot(mode, image);
    residual = image - value * mode;
    double length = residual.norm();
    if (length < 1e-3 * value) break;
    residual /= length;
    residual -= dot(residual, mode) * mode;
    residual /= residual.norm();
    apply(residual, residual_image, all);
    const bool has_direction = direction.cols() > 0;
    if (has_direction) {
      for (const auto& [other, of] : {std::pair{&mode, &image}, std::pair{&residual, &residual_image}}) {
        const double share = dot(direction, *other);
        direction -= share * *other;
        direction_image -= share * *of;
      }
      length = direction.norm();
      direction /= length;
      direction_image /= length;
    }
    const int size = has_direction && length > 1e-8 ? 3 : 2;
    const Motion* const basis[] = {&mode, &residual, &direction};
    const Motion* const images[] = {&image, &residual_image, &direction_image};
    Eigen::MatrixXd small(size, size);
    for (int a = 0; a < size; ++a)
      for (int b = 0; b <= a; ++b) small(a, b) = small(b, a) = dot(*basis[a], *images[b]);
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(small);
    const Eigen::VectorXd best = solver.eigenvectors().col(size - 1);
    Motion next = best[1] * residual, next_image = best[1] * residual_image;
    if (size == 3) {
      next += best[2] * direction;
      next_image += best[2] * direction_image;
    }
    mode = best[0] * mode + next;
    image = best[0] * image + next_image;
    length = mode.norm();
    mode /= length;
    image /= length;
    direction = next / next.norm();
    direction_image = next_image / next.norm();
  }
  const auto part = [&](const Rates& weights) {
    apply(mode, image, weights);
    return dot(mode, image);
  };
  Eigen::Index moves = 0;
  mode.colwise().squaredNorm().maxCoeff(&moves);
  return {ratio_of(part({1, 0, 0}), part({0, 1, 0}), part({0, 0, 1})), static_cast<std::size_t>(moves)};
}

}  // namespace acopla::dem
