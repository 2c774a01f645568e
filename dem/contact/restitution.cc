#include "dem/contact/restitution.h"

#include <algorithm>
#include <cmath>

namespace acopla::dem {
namespace {

double force(const ImpactShape& shape, double alpha, double overlap, double speed) {
  if (overlap < 0) return 0;  // at zero overlap a linear dashpot already acts
  return std::pow(overlap, shape.elastic) + alpha * std::pow(overlap, shape.viscous) * speed;
}

}  // namespace

double restitution_without_tension(const ImpactShape& shape, double alpha) {
  // Runge–Kutta of order 4; the step follows the fastest time scale (the dashpot's when it is strong).
  const double step = 2e-3 / std::max(1.0, alpha);
  double overlap = 0, speed = 1;
  const auto rate = [&](double x, double v) { return -force(shape, alpha, x, v); };
  while (true) {
    const double a1 = rate(overlap, speed);
    const double x2 = overlap + 0.5 * step * speed, v2 = speed + 0.5 * step * a1, a2 = rate(x2, v2);
    const double x3 = overlap + 0.5 * step * v2, v3 = speed + 0.5 * step * a2, a3 = rate(x3, v3);
    const double x4 = overlap + step * v3, v4 = speed + step * a3, a4 = rate(x4, v4);
    const double next_overlap = overlap + step / 6 * (speed + 2 * v2 + 2 * v3 + v4);
    const double next_speed = speed + step / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
    if (next_speed < 0 && force(shape, alpha, next_overlap, next_speed) <= 0) {
      // The force passes zero inside this step: the speed there by interpolation on the force.
      const double f0 = force(shape, alpha, overlap, speed);
      const double f1 = next_overlap > 0 ? force(shape, alpha, next_overlap, next_speed) : 0;
      const double t = f0 > f1 && f0 > 0 ? f0 / (f0 - f1) : 0;
      return -(speed + std::min(1.0, t) * (next_speed - speed));
    }
    overlap = next_overlap;
    speed = next_speed;
  }
}

double dashpot_for(const ImpactShape& shape, double restitution) {
  if (restitution >= 1) return 0;
  double low = 0, high = 1;
  while (restitution_without_tension(shape, high) > restitution) high *= 2;
  while (high - low > 1e-10 * high) {  // e falls with α: halving is enough for a handful of pairs at start-up
    const double middle = 0.5 * (low + high);
    (restitution_without_tension(shape, middle) > restitution ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

double printed_damping_ratio(double restitution) {
  const double log = std::log(restitution);
  return -log / std::sqrt(log * log + M_PI * M_PI);
}

double integrated_restitution(const ImpactShape& shape, double alpha, double step) {
  constexpr int phases = 16;
  double sum = 0;
  for (int phase = 0; phase < phases; ++phase) {
    double overlap = -step * (phase + 0.5) / phases, speed = 1, acceleration = 0;
    do {  // the engine's step (dem/engine.h)
      overlap += step * speed + 0.5 * step * step * acceleration;
      const double predicted = speed + step * acceleration;
      const double next = -std::max(0.0, force(shape, alpha, overlap, predicted));
      speed = predicted + 0.5 * step * (next - acceleration);
      acceleration = next;
    } while (overlap > 0 || speed > 0);
    sum += -speed;
  }
  return sum / phases;
}

double impact_duration(const ImpactShape& shape) {
  // ∫ dx / v from 0 to the peak, twice; energy gives v. The closed form is a beta function (Johnson 1985, §11.4).
  const double n = shape.elastic + 1;
  const double peak = std::pow(n / 2, 1 / n);
  return 2 * peak * std::sqrt(M_PI) * std::tgamma(1 + 1 / n) / std::tgamma(0.5 + 1 / n);
}

}  // namespace acopla::dem
