#include "liggghts/deck.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <memory>

#include "dem/contact/hertz.h"
#include "dem/contact/linear.h"
#include "dem/domain.h"
#include "dem/laws.h"
#include "io/results.h"

namespace acopla::liggghts {
namespace {

using dem::Scene;

// Types are numbered from 1: the materials as particles, then the materials as walls, so that a pair of types knows which it is.
std::size_t particle_type(std::size_t material) { return material + 1; }
std::size_t wall_type(const Scene& scene, std::size_t material) { return scene.materials.size() + material + 1; }
std::size_t type_count(const Scene& scene) { return 2 * scene.materials.size(); }

bool is_hertz(const Scene& scene) { return scene.law_sets().front().normal == dem::Hertz::name; }

// LIGGGHTS makes its dashpot from a restitution by the printed formula. This is the restitution that gives our dashpot there, so that
// both rebound alike.
double printed_restitution(const dem::PairProperties& pair) {
  const double beta = pair.hertz_damping / (2 * std::sqrt(5.0 / 6.0));
  return beta < 1 ? std::exp(-M_PI * beta / std::sqrt(1 - beta * beta)) : 0;
}

// The one radius of a material's particles [m]; NaN where there are several, 0 where there are none.
double only_radius(const Scene& scene, std::size_t material) {
  double smallest = scene.smallest_radius(material), largest = smallest;
  for (const auto& filling : scene.fillings) {
    if (filling.placing != dem::Placing::given && filling.material == material) largest = std::max(largest, filling.largest_radius());
    for (const auto& particle : filling.particles)
      if (particle.material == material) largest = std::max(largest, particle.radius);
  }
  if (scene.start_from)
    for (const auto& content : scene.start_from->contents)
      if (content.material == material) largest = std::max(largest, content.largest_radius);
  return smallest == largest ? smallest : std::nan("");
}

double mass(const Scene& scene, std::size_t material) {
  return scene.materials[material].density * dem::volume_of(3, only_radius(scene, material));
}

// Calls visit(type, type, pair, reduced mass) for every pair of types that can meet.
void for_each_pair(const Scene& scene, const std::function<void(std::size_t, std::size_t, const dem::PairProperties&, double)>& visit) {
  const auto used = scene.particle_materials();
  for (const std::size_t i : used) {
    for (const std::size_t j : used) visit(particle_type(i), particle_type(j), scene.pair(i, j), mass(scene, i) * mass(scene, j) / (mass(scene, i) + mass(scene, j)));
    for (std::size_t j = 0; j < scene.materials.size(); ++j)
      if (!scene.pair(i, j).laws.normal.empty()) visit(particle_type(i), wall_type(scene, j), scene.pair(i, j), mass(scene, i));
  }
}

std::string list(const std::vector<double>& values) {
  std::string text;
  for (const double value : values) text += fmt::format(" {:.17g}", value);
  return text;
}

class Writer {
 public:
  explicit Writer(const Scene& scene) : scene_(scene), laws_(scene.law_sets().front()) {}

  /// e.g. "model hertz tangential history rolling_friction cdt"
  std::string model() const {
    std::string text = is_hertz(scene_) ? "model hertz" : "model hooke/stiffness";
    if (laws_.tangential != "none") text += " tangential history";
    if (laws_.rolling != "none") text += " rolling_friction cdt";
    return text;
  }

  /// No tension; with rolling resistance also against spins about the normal. Last in a command.
  std::string settings() const { return laws_.rolling != "none" ? "limitForce on torsionTorque on" : "limitForce on"; }

  std::string materials() const {
    std::string text;
    if (is_hertz(scene_)) {
      std::vector<double> young, poisson;
      for (int walls = 0; walls < 2; ++walls)
        for (const auto& material : scene_.materials) {
          const bool known = material.shear_modulus > 0;
          young.push_back(known ? material.young() : 1e9);  // no law asks for it
          poisson.push_back(known ? material.poisson : 0.25);
        }
      text += property("youngsModulus", "peratomtype", young) + property("poissonsRatio", "peratomtype", poisson);
      text += pairs("coefficientRestitution", 1, [](const auto& pair, double) { return printed_restitution(pair); });
    } else {
      const auto tangential = [](const auto& pair) { return pair.tangential_values.empty() ? 0 : pair.stiffness / pair.tangential_values[0]; };
      text += pairs("kn", 1, [](const auto& pair, double) { return pair.stiffness; });
      text += pairs("kt", 1, [&](const auto& pair, double) { return tangential(pair); });
      // LIGGGHTS multiplies these by the reduced mass.
      const auto dashpot = [](double ratio, double stiffness, double reduced) { return ratio > 0 ? 2 * ratio * std::sqrt(stiffness / reduced) : 0; };
      text += pairs("gamman", 0, [&](const auto& pair, double reduced) { return dashpot(pair.damping_ratio, pair.stiffness, reduced); });
      text += pairs("gammat", 0, [&](const auto& pair, double reduced) {
        if (pair.tangential_values.empty()) return 0.0;
        const double own = pair.tangential_values[1];
        return dashpot(std::isnan(own) ? pair.damping_ratio : own, tangential(pair), reduced);
      });
    }
    if (laws_.tangential != "none") text += pairs("coefficientFriction", 0, [](const auto& pair, double) { return pair.friction; });
    if (laws_.rolling != "none") text += pairs("coefficientRollingFriction", 0, [](const auto& pair, double) { return pair.rolling_friction; });
    return text + fmt::format("pair_style gran {} {}\npair_coeff * *\n", model(), settings());
  }

  std::string walls() const {
    std::string text;
    std::vector<std::string> meshes;
    int planes = 0;
    for (const auto& wall : scene_.walls) {
      if (!wall.is_plane) {
        meshes.push_back(fmt::format("mesh{}", meshes.size()));
        continue;
      }
      int axis = 0;
      wall.normal.cwiseAbs().maxCoeff(&axis);
      text += fmt::format("fix plane{} all wall/gran {} store_force yes primitive type {} {}plane {:.17g} {}\n", planes++, model(),
                          wall_type(scene_, wall.material), "xyz"[axis], wall.point[axis], settings());
    }
    if (!meshes.empty())
      text += fmt::format("fix meshes all wall/gran {} store_force_contact yes store_force_contact_stress yes mesh n_meshes {} meshes {} {}\n",
                          model(), meshes.size(), fmt::join(meshes, " "), settings());
    return text;
  }

  std::string gravity() const {
    const double size = scene_.gravity.norm();
    if (!(size > 0)) return "";
    const auto& g = scene_.gravity;
    return fmt::format("fix gravity all gravity {:.17g} vector {:.17g} {:.17g} {:.17g}\n", size, g[0], g[1], g[2]);
  }

 private:
  static std::string property(const char* name, const std::string& kind, const std::vector<double>& values) {
    return fmt::format("fix {} all property/global {} {}{}\n", name, name, kind, list(values));
  }
  template <class Value>
  std::string pairs(const char* name, double unused, const Value& value) const {
    const auto types = type_count(scene_);
    std::vector<double> values(types * types, unused);
    for_each_pair(scene_, [&](std::size_t a, std::size_t b, const dem::PairProperties& pair, double reduced) {
      values[(a - 1) * types + b - 1] = values[(b - 1) * types + a - 1] = value(pair, reduced);
    });
    return property(name, fmt::format("peratomtypepair {}", types), values);
  }

  const Scene& scene_;
  dem::LawSet laws_;
};

void check_laws(const Scene& scene, const io::Table& table) {
  const auto sets = scene.law_sets();
  if (sets.size() > 1)
    table.fail("contact", fmt::format("has the laws {} and {}. LIGGGHTS has one set of laws for all pairs: give all the same.", sets[0].text(), sets[1].text()));
  const auto& laws = sets.front();
  const auto refuse = [&](const std::string& name, const char* known) {
    table.fail("contact", fmt::format("has the law {}, which LIGGGHTS has not. Use {}, or solver = \"dem\".", name, known));
  };
  if (laws.normal != dem::Hertz::name && laws.normal != dem::Linear::name) refuse(laws.normal, "hertz or linear");
  if (laws.tangential != "none" && laws.tangential != "mindlin" && laws.tangential != "linear_slider") refuse(laws.tangential, "mindlin or linear_slider");
  if (laws.rolling != "none" && laws.rolling != "constant_torque") refuse(laws.rolling, "constant_torque");
  for_each_pair(scene, [&](std::size_t, std::size_t, const dem::PairProperties& pair, double reduced) {
    if (is_hertz(scene) && printed_restitution(pair) <= 0.05)
      table.fail("contact", fmt::format("has restitution = {:.4g}. The dashpot that gives it is stronger than LIGGGHTS allows: raise it.", pair.restitution));
    if (!is_hertz(scene) && std::isnan(reduced) && pair.damping_ratio > 0)
      table.fail("contact", "has a linear dashpot between particles of several sizes. LIGGGHTS has one dashpot for each pair of materials: give each "
                            "size a material of its own, or use hertz.");
  });
}

void check_walls(const Scene& scene, const io::Table& table) {
  for (const auto& wall : scene.walls) {
    const auto own = table.table("wall").table(wall.name);
    if (wall.glued_diameter > 0) own.fail("glued", "particles are solver = \"dem\"'s. LIGGGHTS touches the mesh itself: remove it.");
    if (wall.motion.moves()) own.fail("motion", "is not handed to LIGGGHTS, whose walls stand here. Use solver = \"dem\" for walls that move.");
    if (wall.is_plane && wall.normal.cwiseAbs().maxCoeff() < 1 - 1e-12)
      own.fail("plane", "is oblique. LIGGGHTS has planes across x, y and z only: give a mesh of two triangles.");
  }
}

void write_data(const Scene& scene, const dem::Particles& particles, const geometry::Box& box, const std::string& path) {
  std::string text = fmt::format("particles of {}\n\n{} atoms\n{} atom types\n", scene.name, particles.size(), type_count(scene));
  for (int d = 0; d < 3; ++d) text += fmt::format("{:.17g} {:.17g} {}lo {}hi\n", box.low[d], box.high[d], "xyz"[d], "xyz"[d]);
  text += "\nAtoms\n\n";
  for (std::size_t i = 0; i < particles.size(); ++i) {
    const auto& p = particles.position[i];
    text += fmt::format("{} {} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g}\n", i + 1, particle_type(particles.material[i]), 2 * p.w,
                        scene.materials[particles.material[i]].density, p.x, p.y, p.z);
  }
  text += "\nVelocities\n\n";
  for (std::size_t i = 0; i < particles.size(); ++i) {
    const dem::Vec3 v = particles.velocity_of(i), w = particles.spin_of(i);
    text += fmt::format("{} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g}\n", i + 1, v[0], v[1], v[2], w[0], w[1], w[2]);
  }
  io::write_whole(path, text);
}

// ASCII, so that LIGGGHTS has the vertices to the last bit, and its triangles are numbered as ours.
void write_mesh(const io::TriangleMesh& mesh, const std::string& path) {
  std::string text = "solid wall\n";
  for (const auto& triangle : mesh.triangles) {
    text += "facet normal 0 0 0\nouter loop\n";
    for (const auto node : triangle) text += fmt::format("vertex {:.17g} {:.17g} {:.17g}\n", mesh.points[node][0], mesh.points[node][1], mesh.points[node][2]);
    text += "endloop\nendfacet\n";
  }
  io::write_whole(path, text + "endsolid wall\n");
}

}  // namespace

void check(const Scene& scene, const io::Table& table) {
  if (scene.dimension != 3) table.fail("solver", "= \"liggghts\" has spheres only, and the case has two dimensions. Use solver = \"dem\".");
  constexpr std::pair<const char*, const char*> unknown[] = {
      {"inlet", "pours particles in while time runs"}, {"outlet", "takes particles away"},   {"settle", "lets the particles settle before time begins"},
      {"energy", "keeps the energy ledger"},           {"partitions", "decides rounding"}};
  for (const auto& [key, does] : unknown)
    if (table.has(key)) table.fail(key, fmt::format("{}, which is not handed to LIGGGHTS. Remove it, or use solver = \"dem\".", does));
  if (table.has("threads")) table.fail("threads", "belongs to solver = \"dem\". LIGGGHTS runs on processes: write processes = 2 instead.");
  if (scene.damping.translation > 0 || scene.damping.rotation > 0 || scene.damping.local > 0)
    table.fail("damping", "is not handed to LIGGGHTS. Remove it, or use solver = \"dem\".");
  if (scene.start_from && scene.start_from->whole)
    table.fail("start_from", "takes the whole state of a \"dem\" run, springs of contacts too. LIGGGHTS takes the particles: write take = \"particles\".");
  if (scene.write_checkpoint) table.table("output").fail("checkpoint", "is not written by LIGGGHTS here. Remove it, or use solver = \"dem\".");
  check_walls(scene, table);
  check_laws(scene, table);
}

std::string laws_in_words(const Scene& scene) {
  const Writer writer(scene);
  return writer.materials() + writer.walls() + writer.gravity();
}

Deck write_deck(const Scene& scene, const dem::Particles& particles, const dem::WallSet& walls, const std::string& folder) {
  Deck deck;
  deck.particles = particles.size();
  const auto base = folder + "/" + scene.name;
  write_data(scene, particles, dem::domain_of(scene, particles, walls), base + ".data");
  const Writer writer(scene);
  double smallest = scene.largest_radius();
  for (const auto& p : particles.position) smallest = std::min(smallest, p.w);
  deck.commands = fmt::format(
      "# {} as LIGGGHTS has it\n"
      "atom_style granular\natom_modify map array\nboundary f f f\nnewton off\ncommunicate single vel yes\nprocessors * * 1\nunits si\n"
      "hard_particles yes\nsoft_particles yes\nread_data \"{}.data\"\nneighbor {:.17g} bin\nneigh_modify delay 0\n",
      scene.name, base, 0.6 * smallest);
  deck.commands += writer.materials();
  for (const auto& wall : scene.walls) {
    if (wall.is_plane) {
      deck.planes.push_back(wall.name);
      continue;
    }
    const auto file = fmt::format("{}_{}.stl", base, wall.name);
    write_mesh(wall.mesh, file);
    deck.commands += fmt::format("fix mesh{} all mesh/surface file \"{}\" type {}\n", deck.meshes.size(), file, wall_type(scene, wall.material));
    deck.meshes.push_back({wall.name, wall.mesh.points, wall.mesh.triangles});
  }
  deck.commands += writer.walls() + writer.gravity() +
                   "fix motion all nve/sphere\nthermo 0\nthermo_style custom step atoms\nthermo_modify lost ignore norm no\n";
  io::write_whole(base + ".in", deck.commands);
  return deck;
}

}  // namespace acopla::liggghts
