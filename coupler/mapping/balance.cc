#include "coupler/mapping/balance.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace acopla::coupler {
namespace {

/// Eight sums at once, each compensated: the round-off of an addition (Knuth's two-sum, which asks for no branch) is kept apart and added at the end.
class CompensatedSums {
 public:
  using Lanes = Eigen::Array<double, 8, 1>;
  void add(const Lanes& values) {
    const Lanes sums = sums_ + values, part = sums - sums_;
    rests_ += (sums_ - (sums - part)) + (values - part);
    sums_ = sums;
  }
  Lanes values() const { return sums_ + rests_; }

 private:
  Lanes sums_ = Lanes::Zero(), rests_ = Lanes::Zero();
};

double fraction(double part, double whole) {
  if (part == 0) return 0;
  return whole > 0 ? part / whole : std::numeric_limits<double>::infinity();
}

}  // namespace

Resultant resultant(std::span<const Vec3> points, std::span<const Vec3> forces, const Vec3& about) {
  if (points.size() != forces.size())
    throw std::invalid_argument("a resultant needs one force for every point");
  CompensatedSums sums;
  CompensatedSums::Lanes row;
  for (std::size_t k = 0; k < points.size(); ++k) {
    const Vec3 arm = points[k] - about, moment = arm.cross(forces[k]);
    const double size = forces[k].norm();
    row << forces[k][0], forces[k][1], forces[k][2], moment[0], moment[1], moment[2], size, arm.norm() * size;
    sums.add(row);
  }
  const auto total = sums.values();
  return {Vec3(total.segment<3>(0)), Vec3(total.segment<3>(3)), total[6], total[7]};
}

Loss loss(const Resultant& sent, const Resultant& received) {
  // A single point sends no moment about itself, yet its force arrives on nodes around it.
  const double turning_size =
      sent.size > 0 ? std::max(sent.turning_size, received.turning_size) : sent.turning_size;
  return {fraction((sent.force - received.force).norm(), sent.size),
          fraction((sent.moment - received.moment).norm(), turning_size)};
}

}  // namespace acopla::coupler
