#include "coupler/mapping/balance.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace acopla::coupler {
namespace {

/// Neumaier's sum: the round-off of each addition is kept apart and added at the end.
class CompensatedSum {
 public:
  void add(double value) {
    const double sum = sum_ + value;
    rest_ += std::abs(sum_) >= std::abs(value) ? (sum_ - sum) + value : (value - sum) + sum_;
    sum_ = sum;
  }
  double value() const { return sum_ + rest_; }

 private:
  double sum_ = 0, rest_ = 0;
};

class CompensatedVector {
 public:
  void add(const Vec3& value) {
    for (int d = 0; d < 3; ++d) sums_[d].add(value[d]);
  }
  Vec3 value() const { return {sums_[0].value(), sums_[1].value(), sums_[2].value()}; }

 private:
  CompensatedSum sums_[3];
};

double fraction(double part, double whole) {
  if (part == 0) return 0;
  return whole > 0 ? part / whole : std::numeric_limits<double>::infinity();
}

}  // namespace

Resultant resultant(std::span<const Vec3> points, std::span<const Vec3> forces, const Vec3& about) {
  if (points.size() != forces.size())
    throw std::invalid_argument("a resultant needs one force for every point");
  CompensatedVector force, moment;
  CompensatedSum size, turning_size;
  for (std::size_t k = 0; k < points.size(); ++k) {
    const Vec3 arm = points[k] - about;
    force.add(forces[k]);
    moment.add(arm.cross(forces[k]));
    size.add(forces[k].norm());
    turning_size.add(arm.norm() * forces[k].norm());
  }
  return {force.value(), moment.value(), size.value(), turning_size.value()};
}

Loss loss(const Resultant& sent, const Resultant& received) {
  // A single point sends no moment about itself, yet its force arrives on nodes around it.
  const double turning_size =
      sent.size > 0 ? std::max(sent.turning_size, received.turning_size) : sent.turning_size;
  return {fraction((sent.force - received.force).norm(), sent.size),
          fraction((sent.moment - received.moment).norm(), turning_size)};
}

}  // namespace acopla::coupler
