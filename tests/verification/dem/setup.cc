#include "setup.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>

namespace acopla::dem::verification {

Scene scene_of(const OneMaterial& s) {
  const bool flat = s.dimension == 2;
  const auto vector = [&](const Vec3& v) { return flat ? fmt::format("[{}, {}]", v[0], v[1]) : fmt::format("[{}, {}, {}]", v[0], v[1], v[2]); };
  std::string text = fmt::format("dimension = {}\nend = 1.0\ngravity = {}\n[g]\nsolver = \"dem\"\n{}\n[g.material.m]\ndensity = {}\n", s.dimension,
                                 vector(s.gravity), s.more, s.density);
  if (s.shear_modulus > 0) text += fmt::format("shear_modulus = {}\npoisson = {}\n", s.shear_modulus, s.poisson);
  text += fmt::format("[[g.contact]]\nbetween = [[\"m\", \"m\"]]\nnormal = {}\ntangential = {}\nrolling = {}\nrestitution = {}\n", s.normal,
                      s.tangential, s.rolling, s.restitution);
  if (s.tangential != "\"none\"") text += fmt::format("friction = {}\n", s.friction);
  if (s.rolling != "\"none\"") text += fmt::format("rolling_friction = {}\n", s.rolling_friction);
  if (s.paper) text += "damping = \"paper\"\n";
  text += fmt::format("[[g.insert]]\nmaterial = \"m\"\ndiameter = {}\ncount = 1\nregion = {{ box = [{}, {}] }}\n", 2 * s.radius,
                      vector(Vec3::Constant(-50)), vector(Vec3::Constant(50)));
  return read_scene(io::Table::from_text(text, "verification.toml"), "g");
}

std::string linear(double stiffness) { return fmt::format("{{ law = \"linear\", stiffness = {} }}", stiffness); }

std::string linear_slider(double ratio, double damping_ratio) {
  if (std::isnan(damping_ratio)) return fmt::format("{{ law = \"linear_slider\", ratio = {} }}", ratio);
  return fmt::format("{{ law = \"linear_slider\", ratio = {}, damping_ratio = {} }}", ratio, damping_ratio);
}

std::string elastic_plastic(double damping_ratio, double stiffness_factor, double twisting) {
  return fmt::format("{{ law = \"elastic_plastic\", damping_ratio = {}, stiffness_factor = {}, twisting = {} }}", damping_ratio, stiffness_factor,
                     twisting);
}

std::unique_ptr<Engine> engine_of(const Scene& scene, const std::vector<Body>& bodies, std::vector<Wall> walls) {
  Particles particles;
  particles.kind = scene.kind();
  for (const auto& body : bodies)
    particles.add(body.at, body.radius, body.density > 0 ? body.density : scene.materials[0].density, 0, body.velocity, body.spin);
  return make_engine(scene, std::move(particles), WallSet(std::move(walls)));
}

Wall plane(const Vec3& point, const Vec3& normal) {
  Wall wall;
  wall.name = "plane";
  wall.is_plane = true;
  wall.point = point;
  wall.normal = normal.normalized();
  return wall;
}

Wall mesh(std::vector<Vec3> points, std::vector<std::array<std::uint32_t, 3>> triangles) {
  Wall wall;
  wall.name = "mesh";
  wall.mesh.points = std::move(points);
  wall.mesh.triangles = std::move(triangles);
  return wall;
}

Wall line(std::vector<Vec3> corners) {
  Wall wall;
  wall.name = "line";
  wall.line = std::move(corners);
  return wall;
}

namespace {
std::size_t index_of(const Engine& engine, std::uint32_t id) {
  const auto& ids = engine.particles().id;
  return static_cast<std::size_t>(std::find(ids.begin(), ids.end(), id) - ids.begin());
}
}  // namespace

Vec3 position(const Engine& engine, std::uint32_t id) { return engine.particles().position[index_of(engine, id)].vector(); }
Vec3 velocity(const Engine& engine, std::uint32_t id) { return engine.particles().velocity_of(index_of(engine, id)); }
Vec3 spin(const Engine& engine, std::uint32_t id) { return engine.particles().spin_of(index_of(engine, id)); }
double mass(const Engine& engine, std::uint32_t id) { return engine.particles().mass_of(index_of(engine, id)); }

const nlohmann::json& reference() {
  static const nlohmann::json loaded = [] {
    std::ifstream file(ACOPLA_DEM_REFERENCE);
    return nlohmann::json::parse(file);
  }();
  return loaded;
}

}  // namespace acopla::dem::verification
