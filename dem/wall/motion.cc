#include "dem/wall/motion.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

namespace acopla::dem {
namespace {

struct Value {
  double value, rate;
};

// Distance and speed `since` the start of a motion that speeds up evenly to 1 over `ramp`.
Value sped_up(double since, double ramp) {
  if (since < 0) return {0, 0};
  if (since < ramp) return {0.5 * since * since / ramp, since / ramp};
  return {since - 0.5 * ramp, 1};
}

// From 0 to 1 over `ramp`, with zero slope at both ends.
Value smooth_step(double since, double ramp) {
  if (since < 0) return {0, 0};
  if (since >= ramp) return {1, 0};
  const double u = since / ramp;
  return {u * u * (3 - 2 * u), 6 * u * (1 - u) / ramp};
}

Value difference(const Value& a, const Value& b) { return {a.value - b.value, a.rate - b.rate}; }

// Between the nodes `left` and `left + 1` of a path; u in [0, 1].
template <class T>
std::pair<T, T> interpolated(const std::vector<double>& times, const std::vector<T>& values, std::size_t left, double time, bool smooth, const T& zero) {
  const double span = times[left + 1] - times[left], u = (time - times[left]) / span;
  const T& a = values[left];
  const T& b = values[left + 1];
  if (!smooth) return {T(a + u * (b - a)), T((b - a) / span)};
  // Slopes at the nodes from the parabola through three of them; at rest at both ends.
  const auto slope = [&](std::size_t node) -> T {
    if (node == 0 || node + 1 == times.size()) return zero;
    const double before = times[node] - times[node - 1], after = times[node + 1] - times[node];
    return T((after / (before + after) / before) * (values[node] - values[node - 1]) +
             (before / (before + after) / after) * (values[node + 1] - values[node]));
  };
  const T p = slope(left), q = slope(left + 1);
  const T rise = b - a;
  const double v = 1 - u;
  return {T(a + (u * u * (3 - 2 * u)) * rise + (span * u * v * v) * p - (span * u * u * v) * q),
          T((6 * u * v / span) * rise + (v * (v - 2 * u)) * p + (u * (u - 2 * v)) * q)};
}

}  // namespace

Motion Motion::translation(const Vec3& velocity, const Timing& timing) {
  Motion motion;
  motion.kind_ = Kind::translation;
  motion.amplitude_ = velocity;
  motion.timing_ = timing;
  return motion;
}

Motion Motion::rotation(const Vec3& centre, const Vec3& axis, double speed, const Timing& timing) {
  Motion motion;
  motion.kind_ = Kind::rotation;
  motion.turns_ = true;
  motion.centre_ = centre;
  motion.axis_ = axis.normalized();
  motion.angle_ = speed;
  motion.timing_ = timing;
  return motion;
}

Motion Motion::vibration(const Vec3& amplitude, double frequency, double phase, const Timing& timing) {
  Motion motion;
  motion.kind_ = Kind::vibration;
  motion.amplitude_ = amplitude;
  motion.frequency_ = 2 * M_PI * frequency;
  motion.phase_ = phase;
  motion.timing_ = timing;
  return motion;
}

Motion Motion::turning_vibration(const Vec3& centre, const Vec3& axis, double amplitude, double frequency, double phase, const Timing& timing) {
  auto motion = vibration(Vec3::Zero(), frequency, phase, timing);
  motion.turns_ = true;
  motion.centre_ = centre;
  motion.axis_ = axis.normalized();
  motion.angle_ = amplitude;
  return motion;
}

Motion Motion::path(std::vector<double> times, std::vector<Vec3> displacements, std::vector<double> angles, const Vec3& centre, const Vec3& axis,
                    bool smooth) {
  assert(times.size() >= 2 && (displacements.empty() || displacements.size() == times.size()) && (angles.empty() || angles.size() == times.size()));
  Motion motion;
  motion.kind_ = Kind::path;
  motion.turns_ = !angles.empty();
  motion.smooth_ = smooth;
  motion.centre_ = centre;
  motion.axis_ = axis.normalized();
  motion.times_ = std::move(times);
  motion.displacements_ = std::move(displacements);
  motion.angles_ = std::move(angles);
  return motion;
}

Motion Motion::servo(const Servo& servo) {
  Motion motion;
  motion.kind_ = Kind::servo;
  motion.servo_ = servo;
  motion.servo_.direction.normalize();
  return motion;
}

Motion Motion::prescribed() {
  Motion motion;
  motion.kind_ = Kind::prescribed;
  return motion;
}

Placement Motion::at(double time) const {
  Placement placement;
  switch (kind_) {
    case Kind::translation:
    case Kind::rotation: {
      const auto travelled = difference(sped_up(time - timing_.start, timing_.ramp), sped_up(time - timing_.stop, timing_.ramp));
      placement.displacement = travelled.value * amplitude_;
      placement.velocity = travelled.rate * amplitude_;
      placement.angle = travelled.value * angle_;
      placement.rate = travelled.rate * angle_;
      break;
    }
    case Kind::vibration: {
      // Without a ramp it stands before `start` where it will begin.
      const double since = time - timing_.start;
      const bool waits = since < 0 && timing_.ramp <= 0;
      const auto envelope = waits ? Value{1, 0} : difference(smooth_step(since, timing_.ramp), smooth_step(time - timing_.stop, timing_.ramp));
      const double phase = frequency_ * std::max(since, 0.0) + phase_, sine = std::sin(phase), cosine = waits ? 0 : std::cos(phase);
      const double value = envelope.value * sine, rate = envelope.rate * sine + envelope.value * frequency_ * cosine;
      placement.displacement = value * amplitude_;
      placement.velocity = rate * amplitude_;
      placement.angle = value * angle_;
      placement.rate = rate * angle_;
      break;
    }
    case Kind::path: {
      const bool before = time <= times_.front(), after = time > times_.back();
      if (before || after) {
        if (!displacements_.empty()) placement.displacement = before ? displacements_.front() : displacements_.back();
        if (!angles_.empty()) placement.angle = before ? angles_.front() : angles_.back();
        break;
      }
      // At a node the speed is that of the stretch that ends there.
      const auto left = static_cast<std::size_t>(std::lower_bound(times_.begin(), times_.end(), time) - times_.begin()) - 1;
      if (!displacements_.empty())
        std::tie(placement.displacement, placement.velocity) = interpolated<Vec3>(times_, displacements_, left, time, smooth_, Vec3::Zero());
      if (!angles_.empty()) std::tie(placement.angle, placement.rate) = interpolated<double>(times_, angles_, left, time, smooth_, 0.0);
      break;
    }
    case Kind::fixed:
    case Kind::servo:
    case Kind::prescribed:
      break;
  }
  return placement;
}

}  // namespace acopla::dem
