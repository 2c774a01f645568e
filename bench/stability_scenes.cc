#include "stability_scenes.h"

#include <fmt/format.h>

#include <cmath>
#include <random>

namespace acopla::bench {

std::vector<LawChoice> all_laws() {
  std::vector<LawChoice> all;
  for (const auto& [normal, tangential] : {std::pair{"hertz", "mindlin"}, std::pair{"linear", "linear_slider"}}) {
    for (const char* rolling : {"none", "constant_torque"}) all.push_back({normal, "none", rolling});
    for (const char* rolling : {"none", "constant_torque", "elastic_plastic"}) all.push_back({normal, tangential, rolling});
  }
  return all;
}

dem::Scene scene_of(const Setting& s, double reach) {
  const bool plane = s.dimension == 2;
  std::string text = fmt::format("dimension = {}\nend = 1.0\n", s.dimension);
  if (s.gravity > 0) text += plane ? fmt::format("gravity = [0, {:.17g}]\n", -s.gravity) : fmt::format("gravity = [0, 0, {:.17g}]\n", -s.gravity);
  text += "[g]\nsolver = \"dem\"\n";
  text += s.more;
  if (s.ledger) text += "energy = true\n";
  if (s.allow_unstable) text += "allow_unstable_step = true\n";
  for (std::size_t k = 0; k < s.species.size(); ++k)
    text += fmt::format("[g.material.m{}]\ndensity = {:.17g}\nshear_modulus = {:.17g}\npoisson = 0.25\n", k, s.species[k].density,
                        s.species[k].shear_modulus);
  for (std::size_t a = 0; a < s.species.size(); ++a)
    for (std::size_t b = a; b < s.species.size(); ++b) {
      text += fmt::format("[[g.contact]]\nbetween = [[\"m{}\", \"m{}\"]]\nrestitution = {:.17g}\n", a, b, s.restitution);
      text += s.laws.normal == "linear" ? fmt::format("normal = {{ law = \"linear\", stiffness = {:.17g} }}\n", s.stiffness)
                                        : fmt::format("normal = \"{}\"\n", s.laws.normal);
      if (s.laws.tangential == "linear_slider")
        text += fmt::format("tangential = {{ law = \"linear_slider\", ratio = {:.17g} }}\nfriction = {:.17g}\n", s.stiffness_ratio, s.friction);
      else if (s.laws.tangential != "none") text += fmt::format("tangential = \"{}\"\nfriction = {:.17g}\n", s.laws.tangential, s.friction);
      if (s.laws.rolling != "none") text += fmt::format("rolling = \"{}\"\nrolling_friction = {:.17g}\n", s.laws.rolling, s.rolling_friction);
    }
  // One filling a species: it names the size, from which the step follows. The bodies are put in by hand.
  const auto corner = [&](double x) { return plane ? fmt::format("[{0:.17g}, {0:.17g}]", x) : fmt::format("[{0:.17g}, {0:.17g}, {0:.17g}]", x); };
  for (std::size_t k = 0; k < s.species.size(); ++k)
    text += fmt::format("[[g.insert]]\nmaterial = \"m{}\"\ndiameter = {:.17g}\ncount = 1\nregion = {{ box = [{}, {}] }}\n", k,
                        2 * s.species[k].radius, corner(-reach), corner(reach));
  return dem::read_scene(io::Table::from_text(text, "stability.toml"), "g");
}

std::vector<dem::Wall> box(int dimension, double side, bool open) {
  std::vector<dem::Wall> walls;
  const auto add = [&](const char* name, const Vec3& point, const Vec3& normal) {
    dem::Wall wall;
    wall.name = name;
    wall.is_plane = true;
    wall.point = point;
    wall.normal = normal;
    walls.push_back(wall);
  };
  const int up = dimension - 1;
  add("floor", Vec3::Zero(), Vec3::Unit(up));
  if (open) return walls;
  add("top", side * Vec3::Unit(up), -Vec3::Unit(up));
  for (int d = 0; d < up; ++d) {
    add("low", Vec3::Zero(), Vec3::Unit(d));
    add("high", side * Vec3::Unit(d), -Vec3::Unit(d));
  }
  return walls;
}

std::unique_ptr<dem::Engine> engine_of(dem::Scene scene, const std::vector<Body>& bodies, std::vector<dem::Wall> walls) {
  dem::Particles particles;
  particles.kind = scene.kind();
  for (const auto& b : bodies)
    particles.add(b.at, b.radius, scene.materials[b.species].density, static_cast<std::uint8_t>(b.species), b.velocity, b.spin);
  scene.walls = walls;
  return dem::make_engine(scene, std::move(particles), dem::WallSet(std::move(walls)));
}

namespace {

// Positions of an engine's particles go back to the bodies, by their ids.
void take_positions(const dem::Engine& engine, std::vector<Body>& bodies) {
  const auto& p = engine.particles();
  for (std::size_t i = 0; i < p.size(); ++i) bodies[p.id[i]].at = p.position[i].vector();
}

}  // namespace

Bed squeezed_bed(Setting setting, int per_edge, double overlap, std::uint64_t seed) {
  setting.laws.tangential = setting.laws.rolling = "none";
  setting.gravity = 0;
  setting.ledger = false;
  setting.restitution = 1;
  setting.allow_unstable = true;  // on the way there overlaps may be deep
  const bool plane = setting.dimension == 2;
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> even(-1, 1);
  Bed bed;
  double volume = 0, largest = 0, smallest = 1e300;
  const int layers = plane ? 1 : per_edge;
  for (int k = 0; k < layers; ++k)
    for (int j = 0; j < per_edge; ++j)
      for (int i = 0; i < per_edge; ++i) {
        Body body;
        body.species = bed.bodies.size() % setting.species.size();
        body.radius = setting.species[body.species].radius * (setting.species.size() == 1 ? 1 + 0.15 * (even(random) + 1) : 1);
        body.at = Vec3(i + 0.5 + 0.3 * even(random), j + 0.5 + 0.3 * even(random), plane ? 0 : k + 0.5 + 0.3 * even(random)) / per_edge;
        volume += dem::volume_of(setting.dimension, body.radius);
        largest = std::max(largest, body.radius);
        smallest = std::min(smallest, body.radius);
        bed.bodies.push_back(body);
      }
  bed.side = std::max(std::pow(volume / (plane ? 0.8 : 0.55), 1.0 / setting.dimension), 2.5 * largest);
  for (auto& b : bed.bodies)
    for (int d = 0; d < setting.dimension; ++d) b.at[d] = largest + b.at[d] * (bed.side - 2 * largest);
  // With strong damping the packing slides down its energy, until nobody moves a 1e-13th of its radius in a step.
  auto scene = scene_of(setting, bed.side);
  const double step = 0.2 * dem::critical_step(scene).seconds;
  const double still = 1e-26 * volume * setting.species[0].density * std::pow(smallest / step, 2);
  for (int round = 0; round < 60; ++round) {
    // Far from rest it creeps; then it is damped as its modes of middling speed are best and as its slowest ones are, by turns.
    setting.more = fmt::format("damping = {{ viscous = {{ translation = {:.17g} }} }}\n", (round == 0 ? 0.5 : round % 2 == 1 ? 0.03 : 0.002) / step);
    scene = scene_of(setting, bed.side);
    const auto engine = engine_of(scene, bed.bodies, box(setting.dimension, bed.side));
    for (int chunk = 0; chunk < 40; ++chunk) {
      engine->advance(250, step);
      if (engine->kinetic_energy() < still) break;
    }
    bed.at_rest = engine->kinetic_energy() < still;
    take_positions(*engine, bed.bodies);
    bed.contacts = engine->contact_count();
    double sum = 0;
    std::size_t count = 0;
    for (std::size_t i = 0; i < bed.bodies.size(); ++i)
      for (std::size_t j = i + 1; j < bed.bodies.size(); ++j) {
        const auto &a = bed.bodies[i], &b = bed.bodies[j];
        const double depth = a.radius + b.radius - (a.at - b.at).norm();
        if (depth > 0) {
          sum += depth / std::min(a.radius, b.radius);
          ++count;
        }
      }
    bed.mean_overlap = count > bed.bodies.size() ? sum / static_cast<double>(count) : 0;
    const double short_of = overlap - bed.mean_overlap;
    if (std::abs(short_of) < 0.2 * overlap) {
      if (bed.at_rest) break;
      continue;
    }
    const double shrink = 1 - 0.7 * std::clamp(short_of, -0.02, 0.02) * smallest / largest;
    bed.side *= shrink;
    for (auto& b : bed.bodies) b.at *= shrink;
  }
  return bed;
}

}  // namespace acopla::bench
