#include "coupler/travel.h"

#include <fmt/format.h>

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "coupler/failure.h"

namespace acopla::coupler {

using geometry::Vec3;

Travel::Travel(const InterfaceCase& interface, const geometry::SurfaceMesh& surface, int dimension, std::span<const Vec3> displacement)
    : interface_(interface), surface_(surface), dimension_(dimension), start_(displacement.begin(), displacement.end()), midway_(surface) {
  start_.resize(surface.points.size(), Vec3::Zero());
}

void Travel::go_on(std::span<const Vec3> displacement) {
  has_moved_ = false;
  for (std::size_t k = 0; k < displacement.size(); ++k) {
    const Vec3 now = surface_.points[k] + 0.5 * (start_[k] + displacement[k]);
    has_moved_ = has_moved_ || now != midway_.points[k];
    midway_.points[k] = now;
  }
  if (has_moved_) {
    const auto start = turn_of(start_), end = turn_of(displacement);
    constexpr double most = 1;  // the mean of a force that turns so far is short by a twenty-fourth
    if (const double angle = start.angularDistance(end); angle > most)
      throw Failure(interface_.from.text(), "following its motion",
                    fmt::format("{}: {} turns by {:.2f} radians in a window, and a mean force has no direction then. Shorten the window.", interface_.at.text(),
                                interface_.from.text(), angle),
                    Failure::Cause::limit);
    turn_ = start.slerp(0.5, end);
  }
  start_.assign(displacement.begin(), displacement.end());
}

std::vector<Vec3> Travel::turned(std::span<const Vec3> forces) const {
  const Eigen::Matrix3d turn = turn_.toRotationMatrix();
  std::vector<Vec3> turned(forces.begin(), forces.end());
  for (auto& force : turned) force = turn * force;
  return turned;
}

// The rotation that brings the mesh nearest to where it is, in the sense of least squares (Kabsch 1976). In the plane a straight line of points is
// enough to see it.
Eigen::Quaterniond Travel::turn_of(std::span<const Vec3> displacement) const {
  const Vec3 centre = surface_.centroid();
  Vec3 mean = Vec3::Zero();
  for (const auto& u : displacement) mean += u / static_cast<double>(displacement.size());
  Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();  // Σ (moved arm) (arm)ᵀ
  for (std::size_t k = 0; k < displacement.size(); ++k) {
    const Vec3 arm = surface_.points[k] - centre;
    moment += (arm + displacement[k] - mean) * arm.transpose();
  }
  Eigen::Matrix3d turn;
  if (dimension_ == 2) {
    turn = Eigen::AngleAxisd(std::atan2(moment(1, 0) - moment(0, 1), moment(0, 0) + moment(1, 1)), Vec3::UnitZ()).toRotationMatrix();
  } else {
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(moment, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const double mirrors = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
    turn = svd.matrixU() * Vec3(1, 1, mirrors).asDiagonal() * svd.matrixV().transpose();
  }
  double worst = 0;
  for (std::size_t k = 0; k < displacement.size(); ++k) {
    const Vec3 arm = surface_.points[k] - centre;
    worst = std::max(worst, (turn * arm - (arm + displacement[k] - mean)).norm());
  }
  constexpr double rigid_to = 1e-6;  // of its size
  if (!(worst <= rigid_to * surface_.extent()))
    throw Failure(interface_.from.text(), "following its motion",
                  fmt::format("{}: {} deforms by {:.3g} m. slides = true is for rigid surfaces.", interface_.at.text(),
                              interface_.from.text(), worst),
                  Failure::Cause::limit);
  return Eigen::Quaterniond(turn).normalized();
}

}  // namespace acopla::coupler
