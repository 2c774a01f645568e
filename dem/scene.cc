#include "dem/scene.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <set>

#include "dem/contact/restitution.h"
#include "dem/feeding/read.h"
#include "dem/laws.h"
#include "dem/start_from.h"
#include "dem/wall/read.h"

namespace acopla::dem {

std::size_t Scene::particle_count() const {
  std::size_t count = 0;
  if (start_from)
    for (const auto& content : start_from->contents) count += content.count;
  for (std::size_t k = 0; k < fillings.size(); ++k)
    count += fillings[k].placing == Placing::given ? fillings[k].particles.size() : radii_of(fillings[k], k, fill_settings()).size();
  return count;
}

std::vector<std::uint8_t> Scene::particle_materials() const {
  std::set<std::uint8_t> used;
  for (const auto& filling : fillings) {
    if (filling.placing != Placing::given) used.insert(filling.material);
    for (const auto& particle : filling.particles) used.insert(particle.material);
  }
  for (const auto& inlet : inlets) used.insert(inlet.material);
  if (start_from)
    for (const auto& content : start_from->contents) used.insert(content.material);
  return {used.begin(), used.end()};
}

std::vector<geometry::Box> Scene::regions() const {
  std::vector<geometry::Box> boxes;
  for (const auto& filling : fillings)
    if (filling.region) boxes.push_back(filling.region->bounds());
  for (const auto& inlet : inlets) boxes.push_back(inlet.region.bounds());
  for (const auto& outlet : outlets) boxes.push_back(outlet.region.bounds());
  return boxes;
}

double Scene::smallest_radius(std::size_t material) const {
  double smallest = std::numeric_limits<double>::infinity();
  for (const auto& filling : fillings) {
    if (filling.placing != Placing::given && filling.material == material) smallest = std::min(smallest, filling.smallest_radius());
    for (const auto& particle : filling.particles)
      if (particle.material == material) smallest = std::min(smallest, particle.radius);
  }
  for (const auto& inlet : inlets)
    if (inlet.material == material) smallest = std::min(smallest, inlet.sizes.smallest_radius());
  if (start_from)
    for (const auto& content : start_from->contents)
      if (content.material == material) smallest = std::min(smallest, content.smallest_radius);
  return std::isfinite(smallest) ? smallest : 0;
}

double Scene::largest_radius() const {
  double largest = 0;
  for (const auto& filling : fillings) largest = std::max(largest, filling.largest_radius());
  for (const auto& inlet : inlets) largest = std::max(largest, inlet.sizes.largest_radius());
  if (start_from)
    for (const auto& content : start_from->contents) largest = std::max(largest, content.largest_radius);
  return largest;
}

std::vector<LawSet> Scene::law_sets() const {
  std::vector<LawSet> sets;
  for (const auto& pair : pairs)
    if (!pair.laws.normal.empty() && std::find(sets.begin(), sets.end(), pair.laws) == sets.end()) sets.push_back(pair.laws);
  return sets;
}

bool Scene::rotates() const {
  const auto sets = law_sets();
  return std::any_of(sets.begin(), sets.end(), [&](const LawSet& set) { return laws->rotates(set); });
}

namespace {

constexpr io::Range density_range{0, 1e6, true, false, "A density is positive, and no solid reaches 1e6 kg/m3."};
constexpr io::Range poisson_range{-1, 0.5, true, true, "Poisson's ratio of a stable isotropic solid is below 0.5."};
constexpr io::Range restitution_range{0, 1, true, false, "1 is elastic; 0 would take an infinite dashpot."};

// One [[contact]] entry: its laws and the values they need.
struct ContactEntry {
  LawSet laws;
  double restitution = 1, friction = 0, rolling_friction = 0;
  std::vector<double> normal, tangential, rolling;
  bool printed_formula = false;
  double own(std::size_t field) const { return normal[field]; }
};

// Where Linear's fields stand.
enum LinearField : std::size_t { linear_stiffness, linear_velocity, linear_height, linear_overlap };

class Reader {
 public:
  Reader(const io::Table& root, const std::string& name) : root_(root), table_(root.table(name)) { scene_.name = name; }

  Scene read() {
    scene_.dimension = static_cast<int>(root_.integer("dimension", 2, 3));
    if (root_.has("gravity")) scene_.gravity = root_.vector("gravity", scene_.dimension);
    table_.text("solver");
    table_.optional_number("advance_limit", io::positive);  // the coupler's key
    read_laws();
    scene_.seed = static_cast<std::uint64_t>(table_.integer("seed", 0, std::numeric_limits<std::int64_t>::max(), 1));
    read_materials();
    read_walls();
    read_feeding();
    read_contacts();
    read_numbers();
    table_.reject_unknown();
    return std::move(scene_);
  }

 private:
  void read_laws() {
    auto laws = std::make_shared<Laws>(Laws::built_in());
    if (root_.has("plugins"))
      for (const auto& library : root_.paths("plugins")) try {
          laws->load(library);
        } catch (const std::runtime_error& error) {
          root_.fail("plugins", fmt::format("names {}, which {}", library, error.what()));
        }
    scene_.laws = laws;
  }

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

  void read_walls() {
    std::vector<std::string> names;
    for (const auto& known : scene_.materials) names.push_back(known.name);
    for (const auto& [name, table] : table_.table_or_empty("wall").named_tables())
      scene_.walls.push_back(read_wall(table, name, names, scene_.dimension));
  }

  void read_feeding() {
    FeedingScope scope{scene_.dimension, {}, {}, scene_.seed};
    for (const auto& known : scene_.materials) {
      scope.materials.push_back(known.name);
      scope.densities.push_back(known.density);
    }
    for (const auto& table : table_.list("insert")) scene_.fillings.push_back(read_filling(table, scope));
    std::size_t index = 0;
    for (const auto& table : table_.list("inlet")) scene_.inlets.push_back(read_inlet(table, scope, index++));
    for (const auto& table : table_.list("outlet")) scene_.outlets.push_back(read_outlet(table, scope));
    read_start();
    if (scene_.fillings.empty() && scene_.inlets.empty() && !scene_.start_from)
      table_.fail(fmt::format("has no particles. Add [[{}.insert]], [[{}.inlet]] or start_from.", table_.name(), table_.name()));
  }

  void read_start() {
    if (table_.has("start_from")) {
      StartFrom start;
      start.where = table_.location("start_from");
      std::string path;
      if (table_.is_table("start_from")) {
        const auto from = table_.table("start_from");
        path = from.path("results");
        start.whole = from.choice("take", {"particles", "state"}, "particles") == "state";
      } else {
        path = table_.path("start_from");
      }
      start.file = find_checkpoint(path);
      if (!scene_.fillings.empty()) table_.fail("start_from", "and insert are both given. Keep one.");
      start.contents = contents_of(start, scene_);
      scene_.start_from = start;
    }
    if (table_.has("settle")) {
      const auto settle = table_.table("settle");
      scene_.settling = Settling{settle.number("kinetic_energy", io::positive, 1e-6), settle.number("limit", io::positive), table_.location("settle")};
      if (scene_.gravity.isZero(0)) table_.fail("settle", "needs gravity.");
      if (scene_.start_from && scene_.start_from->whole) table_.fail("settle", "and start_from with take = \"state\" contradict each other.");
    }
  }

  // A checkpoint, or the only one in the results of a run.
  std::string find_checkpoint(const std::string& path) const {
    if (!std::filesystem::is_directory(path)) return path;
    std::vector<std::string> found;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(path))
      if (entry.path().filename() == "checkpoint.h5") found.push_back(entry.path().string());
    if (found.size() != 1)
      table_.fail("start_from", fmt::format("names {}, which holds {} checkpoints. {}", path, found.empty() ? "no" : "several",
                                            found.empty() ? "Run that case with output = { checkpoint = true }."
                                                          : fmt::format("Name one of {}.", fmt::join(found, ", "))));
    return found.front();
  }

  // A law is its name, or a table with `law` and its own numbers, which the law declares.
  std::vector<double> law(const io::Table& entry, const char* key, const std::vector<std::string>& names, bool optional,
                          const LawInfo* (Laws::*find)(const std::string&) const, std::string& chosen) {
    if (!entry.has(key) && optional) return {};
    const bool table = entry.is_table(key);
    const auto own = table ? entry.table(key) : entry;
    chosen = table ? own.choice("law", names) : entry.choice(key, names);
    std::vector<double> values;
    for (const auto& field : (scene_.laws.get()->*find)(chosen)->fields) {
      const bool required = field.fallback == Field::required;
      if (!table) {
        if (required) entry.fail(key, fmt::format("= \"{}\" needs {}{}: {}. Write {} = {{ law = \"{}\", {} = … }}.", chosen, field.key,
                                                  unit(field), field.doc, key, chosen, field.key));
        values.push_back(field.fallback == Field::optional ? std::nan("") : field.fallback);
      } else if (required) {
        values.push_back(own.number(field.key, field.range));
      } else {
        values.push_back(own.optional_number(field.key, field.range).value_or(field.fallback == Field::optional ? std::nan("") : field.fallback));
      }
    }
    return values;
  }
  static std::string unit(const Field& field) { return *field.unit ? fmt::format(" [{}]", field.unit) : ""; }

  ContactEntry read_contact(const io::Table& entry) {
    ContactEntry contact;
    auto& laws = contact.laws;
    contact.normal = law(entry, "normal", scene_.laws->normals(), false, &Laws::normal, laws.normal);
    contact.tangential = law(entry, "tangential", scene_.laws->tangentials(), true, &Laws::tangential, laws.tangential);
    contact.rolling = law(entry, "rolling", scene_.laws->rollings(), true, &Laws::rolling, laws.rolling);
    if (laws.normal == Linear::name) {
      int rules = 0;
      for (const auto field : {linear_stiffness, linear_velocity, linear_height}) rules += std::isfinite(contact.own(field));
      if (rules != 1)
        entry.fail("normal", "= \"linear\" needs exactly one of stiffness [N/m], characteristic_velocity [m/s] and drop_height [m]: "
                             "normal = { law = \"linear\", stiffness = 1e5 }.");
    }
    if (scene_.laws->rolling(laws.rolling)->needs_friction && laws.tangential == "none")
      entry.fail("rolling", fmt::format("= \"{}\" takes its spring from the tangential law, and there is none. Add tangential.", laws.rolling));
    if (!scene_.laws->has(laws))
      entry.fail("tangential", fmt::format("= \"{}\" does not go with normal = \"{}\": {} goes with {}.", laws.tangential, laws.normal,
                                           laws.normal, fmt::join(scene_.laws->tangentials_of(laws.normal), ", ")));
    contact.restitution = entry.number("restitution", restitution_range);
    contact.printed_formula = entry.choice("damping", {"no_tension", "paper"}, "no_tension") == "paper";
    if (laws.tangential != "none") contact.friction = entry.number("friction", io::non_negative);
    else if (entry.has("friction")) entry.fail("friction", "has no effect without a tangential law. Add tangential = \"mindlin\" or remove it.");
    if (laws.rolling != "none") contact.rolling_friction = entry.number("rolling_friction", io::non_negative);
    else if (entry.has("rolling_friction")) entry.fail("rolling_friction", "has no effect without a rolling law. Add rolling = \"constant_torque\" or remove it.");
    return contact;
  }

  void read_contacts() {
    const auto count = scene_.materials.size();
    std::map<std::pair<std::size_t, std::size_t>, ContactEntry> entries;
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
    pair.laws = contact.laws;
    const bool linear = pair.laws.normal == Linear::name;
    const bool by_impact = linear && std::isfinite(contact.own(linear_velocity));
    if (by_impact || scene_.laws->normal(pair.laws.normal)->needs_moduli || scene_.laws->tangential(pair.laws.tangential)->needs_moduli) {
      for (const auto* material : {&a, &b})
        if (material->shear_modulus <= 0)
          table_.table("material").fail(material->name, fmt::format("needs shear_modulus (or young) and poisson for the laws {}.",
                                                                    contact.laws.text()));
      pair.modulus = 1 / ((1 - a.poisson * a.poisson) / a.young() + (1 - b.poisson * b.poisson) / b.young());
      pair.shear_modulus = 1 / ((2 - a.poisson) / a.shear_modulus + (2 - b.poisson) / b.shear_modulus);
    }
    pair.restitution = contact.restitution;
    pair.friction = contact.friction;
    pair.rolling_friction = contact.rolling_friction;
    pair.normal_values = contact.normal;
    pair.tangential_values = contact.tangential;
    pair.rolling_values = contact.rolling;
    // 2 sqrt(5/6) β; in units of the impact α = 2 sqrt(5/6) β sqrt(3/2), because S_n = (3/2) k sqrt(δ).
    const double printed = printed_damping_ratio(contact.restitution);
    if (!linear)
      pair.hertz_damping = contact.printed_formula ? 2 * std::sqrt(5.0 / 6.0) * printed : dashpot(hertz_impact, contact.restitution) / std::sqrt(1.5);
    pair.damping_ratio = contact.printed_formula ? printed : dashpot(linear_impact, contact.restitution) / 2;
    if (linear) pair.stiffness = stiffness(pair.modulus, i, j, contact);
    else if (pair.laws.normal != Hertz::name) pair.stiffness = slope(pair, i, j);
    return pair;
  }

  // Of a user's normal law, for the step: at an overlap of 5 % of the smaller radius.
  double slope(const PairProperties& pair, std::size_t i, std::size_t j) const {
    const double a = scene_.smallest_radius(i), b = scene_.smallest_radius(j);
    const double radius = a > 0 && b > 0 ? a * b / (a + b) : std::max(a, b), smaller = a > 0 && b > 0 ? std::min(a, b) : std::max(a, b);
    const double mass = scene_.materials[a > 0 ? i : j].density * volume_of(scene_.dimension, smaller);
    return scene_.laws->make(pair, scene_.dimension)->stiffness(0.05 * smaller, radius, mass, mass * radius * radius).normal;
  }

  // The same restitution is usual for all pairs: invert once.
  double dashpot(const ImpactShape& shape, double restitution) {
    const auto [entry, added] = dashpots_.try_emplace({shape.elastic, restitution}, 0.0);
    if (added) entry->second = dashpot_for(shape, restitution);
    return entry->second;
  }

  // The linear spring, given or by one of the papers' rules with the smallest particles of the two materials; against a wall, with the
  // particle's own radius and mass.
  double stiffness(double modulus, std::size_t i, std::size_t j, const ContactEntry& contact) const {
    if (std::isfinite(contact.own(linear_stiffness))) return contact.own(linear_stiffness);
    const double a = scene_.smallest_radius(i), b = scene_.smallest_radius(j);
    const auto mass_of = [&](std::size_t material, double r) { return scene_.materials[material].density * volume_of(scene_.dimension, r); };
    const double radius = a > 0 && b > 0 ? a * b / (a + b) : std::max(a, b);
    const double mass_a = a > 0 ? mass_of(i, a) : 0, mass_b = b > 0 ? mass_of(j, b) : 0;
    const double mass = a > 0 && b > 0 ? mass_a * mass_b / (mass_a + mass_b) : std::max(mass_a, mass_b);
    if (std::isfinite(contact.own(linear_velocity))) return stiffness_of_impact(modulus, radius, mass, contact.own(linear_velocity));
    // Gomes's rule is for the heaviest body that falls onto the smallest overlap allowed.
    const double gravity = scene_.gravity.norm();
    if (!(gravity > 0)) table_.fail("contact", "has a drop_height, which needs gravity. Give gravity, or a stiffness.");
    double heaviest = 0, smallest = std::numeric_limits<double>::infinity();
    for (const auto material : scene_.particle_materials()) {
      heaviest = std::max(heaviest, mass_of(material, scene_.largest_radius()));
      smallest = std::min(smallest, scene_.smallest_radius(material));
    }
    return stiffness_of_fall(heaviest, gravity, contact.own(linear_height), contact.own(linear_overlap) * smallest);
  }

  void read_damping() {
    const auto damping = table_.table_or_empty("damping");
    if (damping.has("viscous")) {
      const auto viscous = damping.table("viscous");
      scene_.damping.translation = viscous.number("translation", io::non_negative, 0);
      scene_.damping.rotation = viscous.number("rotation", io::non_negative, 0);
    }
    constexpr io::Range share{0, 1, false, true, "It is a share of the unbalanced force; 0.7 is usual for quasi-static work."};
    scene_.damping.local = damping.number("local", share, 0);
  }

  void read_numbers() {
    scene_.allow_unstable_step = table_.flag("allow_unstable_step", false);
    scene_.step_fraction = table_.number("step_fraction", io::positive, 0.2);
    scene_.step = table_.optional_number("step", io::positive);
    if (scene_.step && table_.has("step_fraction")) table_.fail("step", "and step_fraction are both given. Keep one.");
    if (scene_.step_fraction > 1 && !scene_.allow_unstable_step)
      table_.fail("step_fraction", fmt::format("= {:.4g} is above the critical step. Use at most 1 (default 0.2), or say "
                                               "allow_unstable_step = true.", scene_.step_fraction));
    read_damping();
    scene_.threads = static_cast<unsigned>(table_.integer("threads", 1, 1024, 1));
    scene_.partitions = static_cast<unsigned>(table_.integer("partitions", 1, 4096, scene_.threads));
    scene_.keeps_ledger = table_.flag("energy", false);
    scene_.drift_limit = table_.number("drift_limit", io::positive, scene_.drift_limit);
    if (table_.has("drift_limit") && !scene_.keeps_ledger) table_.fail("drift_limit", "has no effect without the energy ledger. Add energy = true.");
    if (table_.has("domain")) {
      const auto corners = table_.vectors("domain", scene_.dimension);
      if (corners.size() != 2) table_.fail("domain", "must be two corners, [[x, y, z], [x, y, z]].");
      scene_.domain = {corners[0].cwiseMin(corners[1]), corners[0].cwiseMax(corners[1])};
      if (scene_.dimension == 2) {
        scene_.domain->low[2] = -1;
        scene_.domain->high[2] = 1;
      }
    }
    const auto output = table_.table_or_empty("output");
    scene_.write_particles = output.flag("particles", true);
    scene_.output_every = output.number("every", io::positive, 0);
    scene_.write_checkpoint = output.flag("checkpoint", false);
  }

  const io::Table& root_;
  io::Table table_;
  Scene scene_;
  std::map<std::pair<double, double>, double> dashpots_;
};

}  // namespace

Scene read_scene(const io::Table& root, const std::string& name) { return Reader(root, name).read(); }

}  // namespace acopla::dem
