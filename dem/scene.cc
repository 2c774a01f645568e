#include "dem/scene.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <set>

#include "dem/contact/model.h"
#include "dem/contact/restitution.h"

namespace acopla::dem {

std::size_t Scene::particle_count() const {
  std::size_t count = 0;
  for (const auto& insertion : insertions) count += insertion.count;
  return count;
}

std::vector<std::uint8_t> Scene::particle_materials() const {
  std::set<std::uint8_t> used;
  for (const auto& insertion : insertions) used.insert(insertion.material);
  return {used.begin(), used.end()};
}

namespace {

constexpr io::Range density_range{0, 1e6, true, false, "A density is positive, and no solid reaches 1e6 kg/m3."};
constexpr io::Range poisson_range{-1, 0.5, true, true, "Poisson's ratio of a stable isotropic solid is below 0.5."};
constexpr io::Range restitution_range{0, 1, true, false, "1 is elastic; 0 would take an infinite dashpot."};

// One [[contact]] entry: its laws and the values they need.
struct ContactEntry {
  LawSet laws;
  double restitution = 1, friction = 0, rolling_friction = 0, stiffness = 0, characteristic_velocity = 0, ratio = 20;
  bool printed_formula = false;
};

class Reader {
 public:
  Reader(const io::Table& root, const std::string& name) : root_(root), table_(root.table(name)) { scene_.name = name; }

  Scene read() {
    if (root_.integer("dimension", 2, 3) != 3)
      root_.fail("dimension", "= 2: this version of acopla-dem computes spheres in three dimensions. Use dimension = 3.");
    if (root_.has("gravity")) scene_.gravity = root_.vector("gravity", 3);
    table_.text("solver");
    table_.optional_number("advance_limit", io::positive);  // the coupler's key
    read_materials();
    read_walls();
    read_insertions();
    read_contacts();
    read_numbers();
    table_.reject_unknown();
    return std::move(scene_);
  }

 private:
  void read_materials() {
    for (const auto& [name, table] : table_.table("material").named_tables()) {
      Material material{name, table.number("density", density_range), 0, 0};
      const auto shear = table.optional_number("shear_modulus", io::positive);
      const auto young = table.optional_number("young", io::positive);
      if (shear && young) table.fail("young", "and shear_modulus are both given. Keep one; the other follows with poisson.");
      material.poisson = table.number("poisson", poisson_range, 0);
      if ((shear || young) && !table.has("poisson")) table.fail("needs poisson beside its modulus.");
      material.shear_modulus = shear ? *shear : young ? *young / (2 * (1 + material.poisson)) : 0;
      scene_.materials.push_back(material);
    }
    if (scene_.materials.empty()) table_.fail("material", "names no material. Add e.g. [" + table_.name() + ".material.glass].");
    if (scene_.materials.size() > 200) table_.fail("material", "names more than 200 materials.");
  }

  std::uint8_t material(const io::Table& table) const {
    std::vector<std::string> names;
    for (const auto& known : scene_.materials) names.push_back(known.name);
    const auto name = table.choice("material", names);
    return static_cast<std::uint8_t>(std::find(names.begin(), names.end(), name) - names.begin());
  }

  void read_walls() {
    for (const auto& [name, table] : table_.table_or_empty("wall").named_tables()) {
      Wall wall;
      wall.name = name;
      wall.material = material(table);
      if (table.has("plane") == table.has("mesh")) table.fail("needs exactly one of plane and mesh.");
      if (table.has("plane")) {
        const auto plane = table.table("plane");
        wall.is_plane = true;
        wall.point = plane.vector("point", 3);
        wall.normal = plane.vector("normal", 3);
        if (!(wall.normal.norm() > 0)) plane.fail("normal", "has no length. It points to the side of the particles.");
        wall.normal.normalize();
      } else {
        wall.mesh = io::read_stl(table.path("mesh"));
      }
      scene_.walls.push_back(std::move(wall));
    }
  }

  void read_insertions() {
    for (const auto& table : table_.list("insert")) {
      Insertion insertion;
      insertion.material = material(table);
      insertion.radius = table.number("diameter", io::positive) / 2;
      insertion.count = static_cast<std::size_t>(table.integer("count", 1, 2'000'000'000));
      const auto corners = table.table("region").vectors("box", 3);
      if (corners.size() != 2) table.fail("region", "box must be two corners, [[x, y, z], [x, y, z]].");
      insertion.low = corners[0].cwiseMin(corners[1]);
      insertion.high = corners[0].cwiseMax(corners[1]);
      if (table.has("velocity")) insertion.velocity = table.vector("velocity", 3);
      insertion.where = table.location("count");
      if ((insertion.high - insertion.low).minCoeff() < 2 * insertion.radius)
        table.fail("region", fmt::format("is thinner than one diameter of {:.4g} m: no whole sphere fits.", 2 * insertion.radius));
      scene_.insertions.push_back(insertion);
    }
    if (scene_.insertions.empty()) table_.fail(fmt::format("has no particles. Add [[{}.insert]].", table_.name()));
  }

  // A law is its name, or a table with `law` and its own values.
  std::string law(const io::Table& entry, const char* key, const std::vector<std::string>& names, const char* fallback,
                  ContactEntry& contact) {
    if (!entry.has(key) && fallback) return fallback;
    if (!entry.is_table(key)) return entry.choice(key, names);
    const auto table = entry.table(key);
    const auto name = table.choice("law", names);
    if (name == Linear::name) {
      if (table.has("stiffness") == table.has("characteristic_velocity"))
        table.fail("needs exactly one of stiffness [N/m] and characteristic_velocity [m/s].");
      contact.stiffness = table.optional_number("stiffness", io::positive).value_or(0);
      contact.characteristic_velocity = table.optional_number("characteristic_velocity", io::positive).value_or(0);
    }
    if (name == LinearSlider::name) contact.ratio = table.number("ratio", io::positive, contact.ratio);
    return name;
  }

  ContactEntry read_contact(const io::Table& entry) {
    ContactEntry contact;
    contact.laws.normal = law(entry, "normal", {Hertz::name, Linear::name}, nullptr, contact);
    if (contact.laws.normal == Linear::name && !entry.is_table("normal"))
      entry.fail("normal", "= \"linear\" needs its stiffness: normal = { law = \"linear\", stiffness = 1e5 }.");
    contact.laws.tangential = law(entry, "tangential", {Mindlin::name, LinearSlider::name, "none"}, "none", contact);
    contact.laws.rolling = law(entry, "rolling", {ConstantTorque::name, "none"}, "none", contact);
    const bool hertz = contact.laws.normal == Hertz::name;
    if (contact.laws.tangential != "none" && hertz != (contact.laws.tangential == Mindlin::name))
      entry.fail("tangential", fmt::format("= \"{}\" does not go with normal = \"{}\": mindlin belongs to hertz, linear_slider to linear.",
                                           contact.laws.tangential, contact.laws.normal));
    contact.restitution = entry.number("restitution", restitution_range);
    contact.printed_formula = entry.choice("damping", {"no_tension", "paper"}, "no_tension") == "paper";
    if (contact.laws.tangential != "none") contact.friction = entry.number("friction", io::non_negative);
    else if (entry.has("friction")) entry.fail("friction", "has no effect without a tangential law. Add tangential = \"mindlin\" or remove it.");
    if (contact.laws.rolling != "none") contact.rolling_friction = entry.number("rolling_friction", io::non_negative);
    else if (entry.has("rolling_friction")) entry.fail("rolling_friction", "has no effect without a rolling law. Add rolling = \"constant_torque\" or remove it.");
    return contact;
  }

  void read_contacts() {
    const auto count = scene_.materials.size();
    std::map<std::pair<std::size_t, std::size_t>, ContactEntry> entries;
    bool first = true;
    std::vector<std::string> names;
    for (const auto& known : scene_.materials) names.push_back(known.name);
    const auto index = [&](const io::Table& entry, const std::string& name) {
      const auto found = std::find(names.begin(), names.end(), name);
      if (found == names.end()) {
        const auto nearest = io::nearest_word(name, names);
        entry.fail("between", fmt::format("names the material {}, which is not in {}.material.{}", name, table_.name(),
                                          nearest ? fmt::format(" Did you mean {}?", *nearest) : ""));
      }
      return static_cast<std::size_t>(found - names.begin());
    };
    for (const auto& entry : table_.list("contact")) {
      const auto contact = read_contact(entry);
      if (!first && !(contact.laws == scene_.laws))
        entry.fail(fmt::format("uses {} where the entries before use {}. One scene has one set of laws in this version; "
                               "the values may differ by pair.", contact.laws.text(), scene_.laws.text()));
      scene_.laws = contact.laws;
      first = false;
      for (const auto& [a, b] : entry.text_pairs("between")) {
        const auto i = index(entry, a), j = index(entry, b);
        if (!entries.emplace(std::pair(std::min(i, j), std::max(i, j)), contact).second)
          entry.fail("between", fmt::format("gives the pair {}–{} a second law.", a, b));
      }
    }
    scene_.pairs.resize(count * count);
    for (const auto i : scene_.particle_materials()) {
      std::set<std::size_t> others;
      for (const auto j : scene_.particle_materials()) others.insert(j);
      for (const auto& wall : scene_.walls) others.insert(wall.material);
      for (const auto j : others) {
        const auto found = entries.find({std::min<std::size_t>(i, j), std::max<std::size_t>(i, j)});
        if (found == entries.end())
          table_.fail(fmt::format("has no contact law between {} and {}. Add the pair to a [[{}.contact]] entry.", names[i], names[j],
                                  table_.name()));
        scene_.pairs[i * count + j] = scene_.pairs[j * count + i] = properties(i, j, found->second);
      }
    }
  }

  PairProperties properties(std::size_t i, std::size_t j, const ContactEntry& contact) {
    const auto &a = scene_.materials[i], &b = scene_.materials[j];
    PairProperties pair;
    if (contact.laws.normal == Hertz::name || contact.characteristic_velocity > 0) {
      for (const auto* material : {&a, &b})
        if (material->shear_modulus <= 0)
          table_.table("material").fail(material->name, fmt::format("needs shear_modulus (or young) and poisson for the law {}.",
                                                                    contact.laws.normal));
      pair.modulus = 1 / ((1 - a.poisson * a.poisson) / a.young() + (1 - b.poisson * b.poisson) / b.young());
      pair.shear_modulus = 1 / ((2 - a.poisson) / a.shear_modulus + (2 - b.poisson) / b.shear_modulus);
    }
    pair.restitution = contact.restitution;
    pair.friction = contact.friction;
    pair.rolling_friction = contact.rolling_friction;
    pair.stiffness_ratio = contact.ratio;
    if (contact.laws.normal == Hertz::name) {
      // 2 sqrt(5/6) β; in units of the impact α = 2 sqrt(5/6) β sqrt(3/2), because S_n = (3/2) k sqrt(δ).
      pair.hertz_damping = contact.printed_formula ? 2 * std::sqrt(5.0 / 6.0) * printed_damping_ratio(contact.restitution)
                                                   : dashpot(hertz_impact, contact.restitution) / std::sqrt(1.5);
    } else {
      pair.stiffness = contact.characteristic_velocity > 0 ? from_velocity(pair.modulus, i, j, contact.characteristic_velocity)
                                                           : contact.stiffness;
      pair.damping_ratio = contact.printed_formula ? printed_damping_ratio(contact.restitution)
                                                   : dashpot(linear_impact, contact.restitution) / 2;
    }
    return pair;
  }

  // The same restitution is usual for all pairs: invert once.
  double dashpot(const ImpactShape& shape, double restitution) {
    const auto [entry, added] = dashpots_.try_emplace({shape.elastic, restitution}, 0.0);
    if (added) entry->second = dashpot_for(shape, restitution);
    return entry->second;
  }

  // Eq. 12 with the smallest particles of the two materials; against a wall the particle's own radius and mass.
  double from_velocity(double modulus, std::size_t i, std::size_t j, double speed) const {
    double radius = 0, mass = 0;
    const auto smallest = [&](std::size_t material) -> const Insertion* {
      const Insertion* found = nullptr;
      for (const auto& insertion : scene_.insertions)
        if (insertion.material == material && (!found || insertion.radius < found->radius)) found = &insertion;
      return found;
    };
    const auto sphere_mass = [&](const Insertion& insertion) {
      return scene_.materials[insertion.material].density * 4.0 / 3.0 * M_PI * std::pow(insertion.radius, 3);
    };
    const auto *a = smallest(i), *b = smallest(j);
    if (a && b) {
      radius = a->radius * b->radius / (a->radius + b->radius);
      mass = sphere_mass(*a) * sphere_mass(*b) / (sphere_mass(*a) + sphere_mass(*b));
    } else {
      const auto& own = a ? *a : *b;
      radius = own.radius;
      mass = sphere_mass(own);
    }
    return stiffness_of_impact(modulus, radius, mass, speed);
  }

  void read_numbers() {
    scene_.seed = static_cast<std::uint64_t>(table_.integer("seed", 0, std::numeric_limits<std::int64_t>::max(), 1));
    scene_.allow_unstable_step = table_.flag("allow_unstable_step", false);
    scene_.step_fraction = table_.number("step_fraction", io::positive, 0.2);
    scene_.step = table_.optional_number("step", io::positive);
    if (scene_.step && table_.has("step_fraction")) table_.fail("step", "and step_fraction are both given. Keep one.");
    if (scene_.step_fraction > 1 && !scene_.allow_unstable_step)
      table_.fail("step_fraction", fmt::format("= {:.4g} is above the critical step. Use at most 1 (default 0.2), or say "
                                               "allow_unstable_step = true.", scene_.step_fraction));
    if (table_.has("domain")) {
      const auto corners = table_.vectors("domain", 3);
      if (corners.size() != 2) table_.fail("domain", "must be two corners, [[x, y, z], [x, y, z]].");
      scene_.domain = {corners[0].cwiseMin(corners[1]), corners[0].cwiseMax(corners[1])};
    }
    const auto output = table_.table_or_empty("output");
    scene_.write_particles = output.flag("particles", true);
    scene_.output_every = output.number("every", io::positive, 0);
  }

  const io::Table& root_;
  io::Table table_;
  Scene scene_;
  std::map<std::pair<double, double>, double> dashpots_;
};

}  // namespace

Scene read_scene(const io::Table& root, const std::string& name) { return Reader(root, name).read(); }

}  // namespace acopla::dem
