// Small scenes for the tests: one material on walls of the same material, elastic constants of soft glass.
#pragma once

#include <fmt/format.h>

#include "dem/engine.h"
#include "dem/step.h"

namespace acopla::dem::test {

struct Laws {
  std::string normal = "\"hertz\"", tangential = "mindlin", rolling = "none";
  double restitution = 0.5, friction = 0.5, rolling_friction = 0.0;
};

inline constexpr double radius = 0.01, density = 2500, shear = 5e6, poisson = 0.25;
inline const double mass = density * 4.0 / 3.0 * M_PI * radius * radius * radius;
inline const double young = 2 * shear * (1 + poisson);

inline const Laws hertz_mindlin{};
inline const Laws linear_slider{"{ law = \"linear\", stiffness = 1e4 }", "linear_slider", "none", 0.5, 0.5, 0};

inline Laws with_rolling(Laws laws, double rolling_friction) {
  laws.rolling = "constant_torque";
  laws.rolling_friction = rolling_friction;
  return laws;
}

inline Laws with_elastic_plastic(Laws laws, double rolling_friction) {
  laws.rolling = "elastic_plastic";
  laws.rolling_friction = rolling_friction;
  return laws;
}

/// A scene of those laws, without walls and gravity, and one filling that only names the size.
inline Scene scene_of(const Laws& laws) {
  std::string text = fmt::format(R"(
dimension = 3
end = 1.0
[g]
solver = "dem"
[g.material.glass]
density = {}
shear_modulus = {}
poisson = {}
[[g.contact]]
between = [["glass", "glass"]]
normal = {}
tangential = "{}"
rolling = "{}"
restitution = {}
)", density, shear, poisson, laws.normal, laws.tangential, laws.rolling, laws.restitution);
  if (laws.tangential != "none") text += fmt::format("friction = {}\n", laws.friction);
  if (laws.rolling != "none") text += fmt::format("rolling_friction = {}\n", laws.rolling_friction);
  text += fmt::format("[[g.insert]]\nmaterial = \"glass\"\ndiameter = {}\ncount = 1\nregion = {{ box = [[-50, -50, -50], [50, 50, 50]] }}\n",
                      2 * radius);
  return read_scene(io::Table::from_text(text, "test.toml"), "g");
}

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

/// The floor z = 0 over [-size, size]², cut into 2 n² triangles with alternating diagonals and shaken vertices.
inline Wall triangulated_floor(double size, int n) {
  std::vector<Vec3> points;
  std::vector<std::array<std::uint32_t, 3>> triangles;
  for (int j = 0; j <= n; ++j)
    for (int i = 0; i <= n; ++i) {
      const bool inner = i > 0 && i < n && j > 0 && j < n;
      const double shake = inner ? 0.2 * size / n * std::sin(7.0 * i + 13.0 * j) : 0.0;
      points.emplace_back(-size + 2 * size * i / n + shake, -size + 2 * size * j / n - 0.7 * shake, 0);
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

struct Ball {
  Vec3 at, velocity = Vec3::Zero(), spin = Vec3::Zero();
};

inline std::unique_ptr<Engine> engine_with(Scene scene, const std::vector<Ball>& balls, std::vector<Wall> walls = {}) {
  Particles particles;
  particles.kind = scene.kind();
  for (const auto& ball : balls) particles.add(ball.at, radius, density, 0, ball.velocity, ball.spin);
  scene.walls = walls;
  WallSet set(std::move(walls));
  for (std::size_t w = 0; w < set.walls().size(); ++w)
    if (!set.walls()[w].is_plane) set.send(w);
  return make_engine(scene, std::move(particles), std::move(set));
}

/// Index of a particle by its id (the engine sorts).
inline std::size_t index_of(const Engine& engine, std::uint32_t id) {
  const auto& ids = engine.particles().id;
  return static_cast<std::size_t>(std::find(ids.begin(), ids.end(), id) - ids.begin());
}
inline Vec3 position(const Engine& engine, std::uint32_t id = 0) { return engine.particles().position[index_of(engine, id)].vector(); }
inline Vec3 velocity(const Engine& engine, std::uint32_t id = 0) { return engine.particles().velocity_of(index_of(engine, id)); }
inline Vec3 spin(const Engine& engine, std::uint32_t id = 0) { return engine.particles().spin_of(index_of(engine, id)); }

inline double rayleigh_time() { return M_PI * radius * std::sqrt(density / shear) / (0.1631 * poisson + 0.8766); }

}  // namespace acopla::dem::test
