// Prescribed motions of one contact, for the tests of contact laws: smooth, closed, random.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <random>

#include "dem/contact/model.h"

namespace acopla::dem::test {

inline Vec3 eigen(const Vector<double, 1>& v) { return {v.x, 0, 0}; }
inline Vec3 eigen(const Vector<double, 2>& v) { return {v.x, v.y, 0}; }
inline Vec3 eigen(const Vector<double, 3>& v) { return {v.x, v.y, v.z}; }
template <int size>
Vector<double, size> vector_of(const Vec3& v) {
  if constexpr (size == 1) return {v[0]};
  else if constexpr (size == 2) return {v[0], v[1]};
  else return {v[0], v[1], v[2]};
}

/// A pair of materials in which every law has something to do: it sticks, slides, rolls and yields on the paths below.
inline PairProperties soft_glass() {
  PairProperties pair;
  pair.modulus = 7e6;
  pair.shear_modulus = 2e6;
  pair.stiffness = 1e4;
  pair.hertz_damping = 0.4;
  pair.damping_ratio = 0.2;
  pair.restitution = 0.7;
  pair.friction = 0.3;
  pair.rolling_friction = 0.05;
  pair.normal_values = {1e4, 2e3};
  pair.tangential_values = {3.5, std::nan("")};
  pair.rolling_values = {0.3, 1.2, 0.4};
  return pair;
}

/// The same without anything that dissipates: no dashpots, no limit that is reached, nothing plastic.
inline PairProperties elastic_glass() {
  auto pair = soft_glass();
  pair.hertz_damping = pair.damping_ratio = 0;
  pair.restitution = 1;
  pair.friction = 1e9;
  pair.rolling_friction = 1e9;
  pair.normal_values = {1e4, 0};
  pair.rolling_values = {0, 1.2, 0.4};
  return pair;
}

/// A sum of three sines of a period of 1 with random amplitudes and phases, of size at most 1.
struct Wave {
  double amplitude[3], phase[3];
  explicit Wave(std::mt19937& random) {
    std::uniform_real_distribution<double> share(0.1, 1), angle(0, 2 * M_PI);
    double sum = 0;
    for (int n = 0; n < 3; ++n) {
      amplitude[n] = share(random) / (n + 1);
      phase[n] = angle(random);
      sum += amplitude[n];
    }
    for (double& a : amplitude) a /= sum;
  }
  double at(double t) const {
    double value = 0;
    for (int n = 0; n < 3; ++n) value += amplitude[n] * std::sin(2 * M_PI * (n + 1) * t + phase[n]);
    return value;
  }
  double rate(double t) const {
    double value = 0;
    for (int n = 0; n < 3; ++n) value += amplitude[n] * 2 * M_PI * (n + 1) * std::cos(2 * M_PI * (n + 1) * t + phase[n]);
    return value;
  }
};

/// Overlap, slip and relative rotation each go round a closed smooth path in `period`, the normal standing still.
template <int dimension>
struct ClosedPath {
  using K = Kinematics<double, dimension>;
  static constexpr double period = 5e-3;  ///< [s]; slow impacts of the bodies below last about as long
  double overlap = 1e-4;                  ///< mean [m]
  double breathing = 0.7;                 ///< amplitude of the overlap over its mean
  double sliding = 6e-5;                  ///< amplitude of the tangential displacement [m]: beyond the friction of soft_glass()
  double rolling = 2e-3;                  ///< of the relative rotation [rad]: beyond its rolling friction
  double entry = 0;                       ///< time from 0 on in which slip and rotation begin smoothly [s]
  Vec3 normal, across[2];
  Wave depth, displacement[2], rotation[3];

  explicit ClosedPath(unsigned seed) : ClosedPath(std::mt19937(seed)) {}
  explicit ClosedPath(std::mt19937 random)
      : depth(random), displacement{Wave(random), Wave(random)}, rotation{Wave(random), Wave(random), Wave(random)} {
    std::normal_distribution<double> any;
    normal = Vec3(any(random), any(random), dimension == 3 ? any(random) : 0).normalized();
    across[0] = dimension == 3 ? normal.unitOrthogonal() : Vec3(-normal[1], normal[0], 0);
    across[1] = normal.cross(across[0]);
  }

  /// The contact at time t [s], at the end of a step: slip and spin are what the step moved, over the step.
  K at(double t, double step) const {
    const double phase = t / period;
    K k{};
    k.step = step;
    k.normal = vector_of<dimension>(normal);
    k.overlap = overlap * (1 + breathing * depth.at(phase));
    k.closing_speed = overlap * breathing * depth.rate(phase) / period;
    k.reduced_radius = 0.005;
    k.reduced_mass = 0.005;
    k.reduced_inertia = 1e-7;
    k.rolling_inertia = 3e-7;
    const double before = (t - step) / period;
    const auto place = [&](const Wave& wave, double at) {
      const double x = entry > 0 ? std::min(1.0, at * period / entry) : 1;
      return x * x * (3 - 2 * x) * wave.at(at);
    };
    const auto moved = [&](const Wave& wave) { return (place(wave, phase) - place(wave, before)) / step; };
    const double speed[] = {sliding * moved(displacement[0]), sliding * moved(displacement[1])};
    const Vec3 spin = rolling * Vec3(moved(rotation[0]), moved(rotation[1]), moved(rotation[2]));
    if constexpr (dimension == 2) k.slip = {speed[0]};
    else k.slip = vector_of<3>(speed[0] * across[0] + speed[1] * across[1]);
    k.relative_spin = vector_of<K::turns>(spin);
    k.frame_spin = 0;
    return k;
  }
};

}  // namespace acopla::dem::test
