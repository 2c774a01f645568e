// Two masses on three springs, split into two participants: mass 1 with its wall's spring and the spring between them sends the force that
// this spring exerts on mass 2; mass 2 with its own wall's spring answers with its motion.
//
//   wall –k– (m1) –κ– (m2) –k– wall      m = 1 kg, k = 4π² N/m, κ = 16π² N/m, at rest at u = (1, 0) m
//
// The masses swing in phase at 1 Hz and against each other at 3 Hz: u = ½ (cos 2πt ± cos 6πt).
#pragma once

#include <cmath>
#include <fstream>
#include <numbers>
#include <vector>

#include "protocol/participant.h"

namespace acopla::oscillator {

using geometry::Vec3;

inline constexpr double pi = std::numbers::pi;
inline constexpr double mass = 1, wall_spring = 4 * pi * pi, middle_spring = 16 * pi * pi;

inline double exact(int which, double t) { return 0.5 * (std::cos(2 * pi * t) + (which == 1 ? 1 : -1) * std::cos(6 * pi * t)); }

inline const std::vector<Vec3>* field(const std::vector<protocol::Field>& fields, const char* name) {
  for (const auto& each : fields)
    if (each.name == name) return &each.values;
  return nullptr;
}

/// Place and speed, bit by bit.
inline void write(const std::string& path, double u, double v) { std::ofstream(path) << std::hexfloat << u << ' ' << v; }
inline void read(const std::string& path, double& u, double& v) {
  std::ifstream file(path);
  std::string first, second;
  file >> first >> second;
  u = std::stod(first), v = std::stod(second);
}

/// Mass 1. As particles do, it takes many steps in a window, and follows the surface of the other where it is told that it moves.
class Loader : public protocol::Participant {
 public:
  int steps = 32;              ///< of the classic Runge–Kutta method in a window: exact beside the coupling's error
  double stiffness = middle_spring, wall = wall_spring, own_mass = mass;
  double dashpot = 0, wall_dashpot = 0;  ///< beside the springs [N s/m]
  bool only_pushes = false;    ///< a contact: no force where the spring is longer than unstrained
  double gap = 0;              ///< [m], of the contact
  double u = 1, v = 0;         ///< [m], [m/s]
  double step = 0;             ///< [s] as particles have it, instead of `steps`; 0: none

  protocol::Introduction introduce() const override { return {"oscillator", 3, {"save", "checkpoint"}, step}; }
  std::vector<protocol::Surface> start(const protocol::Run&) override {
    geometry::SurfaceMesh mesh;
    mesh.points.emplace_back(1.0 / 3, 1.0 / 3, 0);
    return {{"spring", mesh, {}, {}}};
  }
  protocol::Advance advance(const protocol::Window& window, const std::vector<protocol::Field>& received) override {
    const double h = window.length, d0 = (*field(received, "displacement"))[0][0], v0 = (*field(received, "velocity"))[0][0];
    const auto *d_end = field(received, "end_displacement"), *v_end = field(received, "end_velocity");
    // A straight line from the window's start; or, between both ends, Hermite's cubic.
    const auto other = [&](double s) {
      if (!d_end) return d0 + s * h * v0;
      const double d1 = (*d_end)[0][0], v1 = (*v_end)[0][0];
      return d0 * (1 + s * s * (2 * s - 3)) + d1 * s * s * (3 - 2 * s) + h * (v0 * s * (s - 1) * (s - 1) + v1 * s * s * (s - 1));
    };
    const auto force = [&](double own, double own_speed, double s) {
      const double stretch = own - other(s) - gap;
      return only_pushes && stretch < 0 ? 0 : stiffness * stretch + dashpot * (own_speed - v0);  // on mass 2
    };
    const auto acceleration = [&](double own, double own_speed, double s) { return (-wall * own - wall_dashpot * own_speed - force(own, own_speed, s)) / own_mass; };
    double impulse = 0;
    if (step > 0) steps = static_cast<int>(std::ceil(h / step * (1 - 1e-9)));
    const double dt = h / steps, ds = 1.0 / steps;
    for (int n = 0; n < steps; ++n) {
      const double s = n * ds, middle = s + ds / 2;
      const double a1 = acceleration(u, v, s), u2 = u + dt / 2 * v, v2 = v + dt / 2 * a1;
      const double a2 = acceleration(u2, v2, middle), u3 = u + dt / 2 * v2, v3 = v + dt / 2 * a2;
      const double a3 = acceleration(u3, v3, middle), u4 = u + dt * v3, v4 = v + dt * a3;
      const double a4 = acceleration(u4, v4, s + ds);
      const double f = (force(u, v, s) + 2 * force(u2, v2, middle) + 2 * force(u3, v3, middle) + force(u4, v4, s + ds)) / 6;
      impulse += dt * f;
      u += dt / 6 * (v + 2 * v2 + 2 * v3 + v4);
      v += dt / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
    }
    history.push_back(u);
    protocol::Advance result;
    result.steps = static_cast<std::uint64_t>(steps);
    result.fields.push_back({"spring", "force", {Vec3(impulse / h, 0, 0)}});
    result.quantities = {{"u", u}, {"v", v}};
    if (window.estimate) {
      const bool touches = !only_pushes || u - other(1) - gap >= 0;
      result.fields.push_back({"spring", "stiffness", {Vec3::Constant(touches ? stiffness : 0)}});
      result.fields.push_back({"spring", "dashpot", {Vec3::Constant(touches ? dashpot : 0)}});
      result.fields.push_back({"spring", "mass", {Vec3::Constant(touches ? own_mass : 0)}});
    }
    return result;
  }
  void save() override { saved_ = {u, v, static_cast<double>(history.size())}; }
  void restore() override {
    u = saved_[0], v = saved_[1];
    history.resize(static_cast<std::size_t>(saved_[2]));
  }
  void checkpoint(const std::string& folder) override { write(folder + "/first.txt", u, v); }
  void resume(const std::string& folder) override { read(folder + "/first.txt", u, v); }

  std::vector<double> history;  ///< u at the end of each window

 private:
  Vec3 saved_;
};

/// Mass 2: the trapezoidal rule under the mean force of the window, its acceleration anew from that force.
class Structure : public protocol::Participant {
 public:
  double u = 0, v = 0, own_mass = mass, wall = wall_spring;
  bool knows_its_mass = false;  ///< and says it where it is asked, so that the coupler can judge
  bool was_asked = false;

  protocol::Introduction introduce() const override { return {"oscillator", 3, {"save", "checkpoint"}}; }
  std::vector<protocol::Surface> start(const protocol::Run& run) override {
    geometry::SurfaceMesh mesh;
    mesh.points = {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)};
    mesh.add_face(geometry::FaceKind::triangle3, std::vector<std::uint32_t>{0, 1, 2});
    // A rigid body of three nodes: a third of the force, and of the mass, each.
    std::vector<Vec3> masses;
    was_asked = run.wants_mass;
    if (knows_its_mass && was_asked) masses.assign(3, Vec3::Constant(own_mass / 3));
    return {{"mass", mesh, std::vector<Vec3>(3, Vec3(u, 0, 0)), std::vector<Vec3>(3, Vec3(v, 0, 0)), masses}};
  }
  protocol::Advance advance(const protocol::Window& window, const std::vector<protocol::Field>& received) override {
    double f = 0;
    for (const auto& value : *field(received, "force")) f += value[0];
    const double h = window.length, a = (f - wall * u) / own_mass;
    // u' = u + h v + h²/4 (a + a'), a' = (f − k u')/m
    const double next = (u + h * v + h * h / 4 * (a + f / own_mass)) / (1 + h * h / 4 * wall / own_mass);
    v += h / 2 * (a + (f - wall * next) / own_mass);
    u = next;
    history.push_back(u);
    velocities.push_back(v);
    protocol::Advance result;
    result.steps = 1;
    result.fields = {{"mass", "displacement", std::vector<Vec3>(3, Vec3(u, 0, 0))}, {"mass", "velocity", std::vector<Vec3>(3, Vec3(v, 0, 0))}};
    result.quantities = {{"u", u}, {"v", v}};
    return result;
  }
  void save() override { saved_ = {u, v, static_cast<double>(history.size())}; }
  void restore() override {
    u = saved_[0], v = saved_[1];
    history.resize(static_cast<std::size_t>(saved_[2]));
    velocities.resize(history.size());
  }
  void checkpoint(const std::string& folder) override { write(folder + "/second.txt", u, v); }
  void resume(const std::string& folder) override { read(folder + "/second.txt", u, v); }

  std::vector<double> history, velocities;  ///< at the end of each window

 private:
  Vec3 saved_;
};

}  // namespace acopla::oscillator
