#include "geometry/couple.h"

#include <Eigen/Dense>
#include <cassert>

namespace acopla::geometry {

CoupleCarrier couple_carrier(std::span<const Vec3> nodes, double thinness) {
  CoupleCarrier carrier{Vec3::Zero(), Eigen::Matrix3d::Zero(), Eigen::Matrix3d::Zero()};
  for (const auto& node : nodes) carrier.centre += node;
  if (!nodes.empty()) carrier.centre /= static_cast<double>(nodes.size());

  // Nodes that coincide differ from their mean by round-off, which must not pass for an arm.
  double round_off = 0;
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
  for (const auto& node : nodes) {
    round_off += 1e-28 * node.squaredNorm();
    const Vec3 d = node - carrier.centre;
    inertia += d.squaredNorm() * Eigen::Matrix3d::Identity() - d * d.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(inertia);
  for (int axis = 0; axis < 3; ++axis) {
    const double value = eigen.eigenvalues()[axis];
    const Vec3 direction = eigen.eigenvectors().col(axis);
    const Eigen::Matrix3d projector = direction * direction.transpose();
    if (value > round_off && value > thinness * eigen.eigenvalues()[2])
      carrier.compliance += projector / value;
    else
      carrier.lost += projector;
  }
  return carrier;
}

bool couple_forces(std::span<const Vec3> nodes, const Vec3& couple, std::span<Vec3> forces,
                   double thinness) {
  assert(nodes.size() == forces.size());
  for (auto& force : forces) force.setZero();
  if (couple.isZero(0)) return true;

  const auto carrier = couple_carrier(nodes, thinness);
  // The axis of a line of nodes is known to round-off, so a couple perpendicular to it has a rest
  // of this size.
  constexpr double round_off = 1e-12;
  if (!((carrier.lost * couple).norm() <= round_off * couple.norm())) return false;
  const Vec3 turn = carrier.compliance * couple;
  for (std::size_t k = 0; k < nodes.size(); ++k) forces[k] = turn.cross(nodes[k] - carrier.centre);
  return true;
}

}  // namespace acopla::geometry
