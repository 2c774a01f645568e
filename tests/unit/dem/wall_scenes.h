// Walls for the tests, and one partition of particles on walls alone: no engine, no particle meets another.
#pragma once

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include "dem/contact/model.h"
#include "dem/kernels/kernel_of.h"
#include "dem/wall/contacts.h"

namespace acopla::dem::test::walls {

inline constexpr double radius = 0.01, density = 2500, shear = 5e6, poisson = 0.25;
inline const double ball_mass = density * 4.0 / 3.0 * M_PI * radius * radius * radius;
inline const double disc_mass = density * M_PI * radius * radius;

inline Wall plane(const Vec3& point, const Vec3& normal) {
  Wall wall;
  wall.name = "plane";
  wall.is_plane = true;
  wall.point = point;
  wall.normal = normal.normalized();
  return wall;
}

inline Wall mesh(std::vector<Vec3> points, std::vector<std::array<std::uint32_t, 3>> triangles) {
  Wall wall;
  wall.name = "mesh";
  wall.mesh.points = std::move(points);
  wall.mesh.triangles = std::move(triangles);
  return wall;
}

inline Wall line(std::vector<Vec3> corners, bool closed = false) {
  Wall wall;
  wall.name = "line";
  wall.line = std::move(corners);
  wall.closed = closed;
  return wall;
}

/// The floor z = height(x, y) over [-size, size]², cut into 2 n² triangles with alternating diagonals and shaken vertices.
template <class Height>
Wall terrain(double size, int n, const Height& height) {
  std::vector<Vec3> points;
  std::vector<std::array<std::uint32_t, 3>> triangles;
  for (int j = 0; j <= n; ++j)
    for (int i = 0; i <= n; ++i) {
      const bool inner = i > 0 && i < n && j > 0 && j < n;
      const double shake = inner ? 0.2 * size / n * std::sin(7.0 * i + 13.0 * j) : 0.0;
      const double x = -size + 2 * size * i / n + shake, y = -size + 2 * size * j / n - 0.7 * shake;
      points.emplace_back(x, y, height(x, y));
    }
  const auto at = [&](int i, int j) { return static_cast<std::uint32_t>(j * (n + 1) + i); };
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      const auto a = at(i, j), b = at(i + 1, j), c = at(i + 1, j + 1), d = at(i, j + 1);
      if ((i + j) % 2) {
        triangles.push_back({a, b, c});
        triangles.push_back({a, c, d});
      } else {
        triangles.push_back({a, b, d});
        triangles.push_back({b, c, d});
      }
    }
  return mesh(std::move(points), std::move(triangles));
}
inline Wall triangulated_floor(double size, int n) {
  return terrain(size, n, [](double, double) { return 0.0; });
}

/// The line y = 0 over [-size, size] in n unequal segments.
inline Wall split_line(double size, int n) {
  std::vector<Vec3> corners;
  for (int i = 0; i <= n; ++i) corners.emplace_back(-size + 2 * size * i / n + (i > 0 && i < n ? 0.3 * size / n * std::sin(5.0 * i) : 0.0), 0, 0);
  return line(std::move(corners));
}

inline Wall moved(Wall wall, const Motion& motion) {
  wall.motion = motion;
  return wall;
}
inline Wall glued(Wall wall, double diameter, double spacing = 0) {
  wall.glued_diameter = diameter;
  wall.glued_spacing = spacing;
  return wall;
}

inline PairProperties glass(double restitution_damping = 0.3) {
  PairProperties pair;
  const double young = 2 * shear * (1 + poisson);
  pair.modulus = 0.5 * young / (1 - poisson * poisson);
  pair.shear_modulus = 0.5 * shear / (2 - poisson);
  pair.stiffness = 1e4;
  pair.hertz_damping = pair.damping_ratio = restitution_damping;
  pair.friction = 0.5;
  pair.rolling_friction = 0.2;
  pair.tangential_values = {20, std::nan("")};
  return pair;
}

using HertzMindlin = ContactModel<Hertz, Mindlin, FreeRolling>;
using RollingHertzMindlin = ContactModel<Hertz, Mindlin, ConstantTorque>;
using Slider = ContactModel<Linear, LinearSlider, FreeRolling>;
using RollingSlider = ContactModel<Linear, LinearSlider, ConstantTorque>;

template <class Model, int dimension>
KernelTable table_of(const PairProperties& pair) {
  KernelTable table;
  table.materials = 1;
  table.group = {0};
  table.kernel.push_back(std::make_unique<KernelOf<Model, dimension>>(pair));
  return table;
}

struct Body {
  Vec3 at, velocity = Vec3::Zero(), spin = Vec3::Zero();
};

/// Velocity Verlet with predicted velocities, as the engine's.
class Drop {
 public:
  Drop(int dimension, KernelTable kernels, std::vector<Wall> wall_list, const std::vector<Body>& bodies, const Vec3& gravity = Vec3::Zero(),
       double skin = 0.1 * radius, bool sends = true)
      : kernels_(std::move(kernels)), walls(std::move(wall_list)), gravity_(gravity), skin_(skin) {
    particles.kind = {dimension, kernels_.of(0, 0).rotates()};
    for (const auto& body : bodies) particles.add(body.at, radius, density, 0, body.velocity, body.spin);
    for (std::size_t w = 0; sends && w < walls.walls().size(); ++w) walls.send(w);
    sum = WallLoadSum(walls, 1);
    acceleration_.assign(particles.size(), Vec3::Zero());
    turning_.assign(particles.size(), Vec3::Zero());
  }

  void rebuild() {
    SavedWallHistories saved;
    contacts.collect(particles, saved);
    saved.sort();
    walls.mark(Vec3::Constant(-1), Vec3::Constant(1), radius);
    contacts.find(kernels_, walls, particles, 0, static_cast<std::uint32_t>(particles.size()), skin_);
    contacts.restore(walls, particles, saved);
    reference_ = particles.position;
  }
  /// The same with the particles in reverse order.
  void reverse() {
    SavedWallHistories saved;
    contacts.collect(particles, saved);
    saved.sort();
    std::vector<std::uint32_t> order(particles.size());
    for (std::uint32_t k = 0; k < order.size(); ++k) order[k] = static_cast<std::uint32_t>(order.size()) - 1 - k;
    particles.reorder(order);
    std::reverse(acceleration_.begin(), acceleration_.end());
    std::reverse(turning_.begin(), turning_.end());
    walls.mark(Vec3::Constant(-1), Vec3::Constant(1), radius);
    contacts.find(kernels_, walls, particles, 0, static_cast<std::uint32_t>(particles.size()), skin_);
    contacts.restore(walls, particles, saved);
    reference_ = particles.position;
  }

  void evaluate(double step) {
    std::fill(particles.force.begin(), particles.force.end(), Record{});
    std::fill(particles.torque.begin(), particles.torque.end(), Record{});
    contacts.update(walls, particles, time);
    contacts.evaluate(kernels_, walls, particles, step, sum.of(0), nullptr);
    walls.begin_forces();
    walls.add_forces(contacts.resultants());
  }

  void start(double step) {
    rebuild();
    sum.begin_last();
    evaluate(step);
    accelerate();
    started_ = true;
  }

  WallLoad advance(int steps, double step) {
    if (!started_) start(step);
    sum.begin();
    for (int k = 0; k < steps; ++k) {
      double farthest = 0;
      for (std::size_t i = 0; i < particles.size(); ++i) {
        auto &x = particles.position[i], &v = particles.velocity[i];
        const Vec3 velocity = particles.velocity_of(i), spin = particles.spin_of(i);
        x.add(velocity * step + 0.5 * step * step * acceleration_[i]);
        set(v, velocity + step * acceleration_[i]);
        particles.set_spin(i, spin + step * turning_[i]);
        farthest = std::max(farthest, (x.vector() - reference_[i].vector()).norm());
      }
      time += step;
      walls.move(time, step);
      if (2 * (farthest + walls.travel_since_mark()) >= skin_) rebuild(), ++rebuilds;
      if (k + 1 == steps) sum.begin_last();
      evaluate(step);
      const auto before = acceleration_, turned = turning_;
      accelerate();
      for (std::size_t i = 0; i < particles.size(); ++i) {
        set(particles.velocity[i], particles.velocity_of(i) + 0.5 * step * (acceleration_[i] - before[i]));
        particles.set_spin(i, particles.spin_of(i) + 0.5 * step * (turning_[i] - turned[i]));
      }
    }
    return sum.finish(walls, steps);
  }

  Vec3 at(std::size_t i = 0) const { return particles.position[i].vector(); }
  /// Force and torque of the last evaluation on a particle.
  Vec3 force(std::size_t i = 0) const {
    const auto& f = particles.force[i];
    return {f.x, f.y, particles.kind.dimension == 3 ? f.z : 0};
  }
  Vec3 torque(std::size_t i = 0) const {
    if (particles.kind.dimension == 2) return {0, 0, particles.force[i].z};
    return particles.kind.rotates ? particles.torque[i].vector() : Vec3(Vec3::Zero());
  }
  template <class Archive>
  void state(Archive& archive) {
    archive("particles", particles);
    archive("walls", walls);
    archive("contacts", contacts);
    archive("sum", sum);
    archive("time", time);
    archive("rebuilds", rebuilds);
    archive("acceleration", acceleration_);
    archive("turning", turning_);
    archive("reference", reference_);
  }
  const KernelTable& kernels() const { return kernels_; }

 private:
  KernelTable kernels_;

 public:
  Particles particles;
  WallSet walls;
  WallContactList contacts;
  WallLoadSum sum;
  double time = 0;
  int rebuilds = 0;

 private:
  void set(Record& v, const Vec3& velocity) {
    v.x = velocity[0];
    v.y = velocity[1];
    if (particles.kind.dimension == 3) v.z = velocity[2];
  }
  void accelerate() {
    for (std::size_t i = 0; i < particles.size(); ++i) {
      acceleration_[i] = force(i) / particles.mass_of(i) + gravity_;
      turning_[i] = particles.kind.rotates ? Vec3(torque(i) / particles.inertia_of(i)) : Vec3(Vec3::Zero());
    }
  }

  Vec3 gravity_;
  double skin_;
  bool started_ = false;
  std::vector<Vec3> acceleration_, turning_;
  std::vector<Record> reference_;
};

inline std::vector<NearestPoint> contacts_at(const WallSet& set, const Vec3& centre, double r = radius) {
  std::vector<std::uint32_t> near;
  set.find_near(centre, r, near);
  std::vector<NearestPoint> found;
  NearestPoint nearest;
  for (const auto element : near)
    if (set.touches(element, centre, r, nearest)) found.push_back(nearest);
  keep_contacts(set, r, found);
  return found;
}

}  // namespace acopla::dem::test::walls
