#include "fem/settings.h"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

#include "fem/baseline.h"

namespace acopla::fem {
namespace {

constexpr io::Range poisson_range{
    -1, 0.5, true, true,
    "Poisson's ratio of a stable compressible solid lies there; a rubber or undrained soil takes "
    "0.4999 with locking = \"b_bar\"."};
constexpr double gibibyte = 1ull << 30;
/// Above it the volumetric strain of plain cells locks: errors of stress grow as 1 / (1 − 2 ν).
constexpr double nearly_incompressible = 0.495;

Material read_material(const io::Table& table, const Formulation& formulation, int dimension) {
  Material material;
  material.young = table.number("young", io::positive);
  material.poisson = table.number("poisson", poisson_range);
  material.density = table.optional_number("density", io::positive);
  if (table.choice("law", {"st_venant_kirchhoff", "neo_hooke"}, "st_venant_kirchhoff") == "neo_hooke")
    material.law = Material::Law::neo_hooke;
  if (table.has("law") && !formulation.large)
    table.fail("law", "belongs to displacements = \"large\"; small ones know Hooke's law alone.");
  if (material.law == Material::Law::neo_hooke && dimension == 2 && formulation.plane == Formulation::Plane::stress)
    table.fail("law", "= \"neo_hooke\" is there for plane strain and solids, not for plane stress. Use \"st_venant_kirchhoff\", or model the thickness.");
  const bool constrained = dimension == 3 || formulation.plane == Formulation::Plane::strain;
  if (constrained && material.poisson > nearly_incompressible &&
      formulation.locking == Formulation::Locking::untreated)
    table.fail("poisson", fmt::format("= {:.6g} is nearly incompressible: plain cells would lock. "
                                      "Add locking = \"b_bar\" to the structure.",
                                      material.poisson));
  return material;
}

std::vector<Settings::MaterialOfPart> read_materials(const io::Table& structure,
                                                     const Settings& settings) {
  const auto table = structure.table("material");
  std::vector<Settings::MaterialOfPart> materials;
  const auto everywhere = [&]() -> std::vector<Settings::MaterialOfPart> {
    return {{table, "", read_material(table, settings.formulation, settings.dimension)}};
  };
  if (table.has("young") || table.has("poisson") || table.has("density")) return everywhere();
  for (const auto& [name, part] : table.named_tables()) {
    const auto group = part.text("on", name);
    try {
      find_group(settings.mesh.groups, group, settings.dimension);
    } catch (const std::invalid_argument& error) {
      if (part.has("on"))
        part.fail("on", fmt::format("names \"{}\", which {}", group, error.what()));
      table.fail(name, error.what());
    }
    materials.push_back(
        {part, group, read_material(part, settings.formulation, settings.dimension)});
  }
  if (materials.empty()) return everywhere();  // which says what is missing
  return materials;
}

std::array<bool, 3> read_directions(const io::Table& fix, int dimension) {
  if (!fix.has("directions")) return {true, true, true};
  const std::string axes = dimension == 2 ? "xy" : "xyz";
  std::array<bool, 3> directions{};
  for (const auto& word : fix.texts("directions")) {
    const auto axis = word.size() == 1 ? axes.find(word) : std::string::npos;
    if (axis == std::string::npos)
      fix.fail("directions", "has \"" + word + "\"; directions are \"x\"" +
                                 (dimension == 2 ? " and \"y\"." : ", \"y\" and \"z\"."));
    directions[axis] = true;
  }
  if (directions == std::array<bool, 3>{})
    fix.fail("directions", "is empty. Leave it out to hold all directions.");
  return directions;
}

MotionHistory read_history(const io::Table& table, MotionHistory::Gives gives) {
  using Gives = MotionHistory::Gives;
  MotionHistory history{.amplitude = {}, .gives = gives};
  if (table.has("record")) {
    for (const char* other : {"ramp", "amplitude"})
      if (table.has(other)) table.fail(other, "and record are both given. Keep one of them.");
    history.amplitude = read_record(table, "record");
  } else {
    if (gives == Gives::accelerations && !table.has("amplitude"))
      table.fail("acceleration", "needs a record, or an amplitude over time: how long does it go on?");
    history.amplitude = read_amplitude(table);
  }
  if (gives == Gives::accelerations) {
    if (table.choice("baseline", {"corrected", "raw"}, "corrected") == "corrected") history.amplitude = correct_baseline(history.amplitude);
  } else if (table.has("baseline")) {
    if (gives != Gives::velocities || history.amplitude.constant())
      table.fail("baseline", "belongs to a record of velocities or accelerations, or to their amplitude over time. Leave it out.");
    // Kept unless asked: a velocity may mean to go on.
    if (table.choice("baseline", {"corrected", "raw"}, "raw") == "corrected") history.amplitude = correct_velocities(history.amplitude);
  }
  return history;
}

Settings::Support read_move(const io::Table& table, const Settings& settings) {
  using Gives = MotionHistory::Gives;
  std::string key;
  for (const char* motion : {"displacement", "velocity", "acceleration"}) {
    if (!table.has(motion)) continue;
    if (!key.empty()) table.fail(fmt::format("has both {} and {}. Keep one of them.", key, motion));
    key = motion;
  }
  if (key.empty()) table.fail("says no motion. Give it a displacement [m], a velocity [m/s] or an acceleration [m/s2].");
  const auto gives = key == "displacement" ? Gives::displacements : key == "velocity" ? Gives::velocities : Gives::accelerations;
  Settings::Support support{
      .table = table,
      .part = read_part(table, settings.mesh.groups, settings.dimension, settings.dimension - 1),
      .directions = read_directions(table, settings.dimension),
      .moves = true,
      .value = table.vector(key, settings.dimension),
      .history = read_history(table, gives)};
  return support;
}

std::vector<Settings::Support> read_supports(const io::Table& table, const Settings& settings) {
  std::vector<Settings::Support> supports;
  if (table.has("fix"))
    for (const auto& [name, fix] : table.table("fix").named_tables())
      supports.push_back(
          {.table = fix,
           .part = read_part(fix, settings.mesh.groups, settings.dimension, settings.dimension - 1),
           .directions = read_directions(fix, settings.dimension),
           .moves = false,
           .value = Vec3::Zero(),
           .history = {}});
  if (table.has("move"))
    for (const auto& [name, move] : table.table("move").named_tables())
      supports.push_back(read_move(move, settings));
  if (supports.empty() && settings.foundations.empty() && !settings.motion)
    table.fail("has no table fix: nothing holds the structure. Add [" + table.name() +
               ".fix.SURFACE] for a physical " + (settings.dimension == 2 ? "curve" : "surface") +
               " of the mesh.");
  return supports;
}

SolverOptions read_solver(const io::Table& table) {
  using Kind = SolverOptions::Kind;
  SolverOptions options;
  const auto kind = table.choice("linear_solver", {"auto", "direct", "cg"}, "auto");
  options.kind = kind == "cg" ? Kind::cg : kind == "direct" ? Kind::direct : Kind::automatic;
  options.memory_limit =
      gibibyte * table.number("memory_limit", io::positive, options.memory_limit / gibibyte);
  constexpr io::Range tolerances{1e-15, 1e-6, false, false,
                                 "Reactions are exact to about a thousand times the tolerance."};
  options.tolerance = table.number("tolerance", tolerances, options.tolerance);
  return options;
}

Formulation read_formulation(const io::Table& table, int dimension) {
  Formulation formulation;
  if (dimension == 2) {
    if (table.choice("plane", {"strain", "stress"}, "strain") == "stress")
      formulation.plane = Formulation::Plane::stress;
    formulation.thickness = table.number("thickness", io::positive, 1.0);
  } else {
    for (const char* key : {"plane", "thickness"})
      if (table.has(key))
        table.fail(key, "belongs to a structure in 2D; the case says dimension = 3.");
  }
  if (table.choice("locking", {"none", "b_bar"}, "none") == "b_bar") {
    if (dimension == 2 && formulation.plane == Formulation::Plane::stress)
      table.fail("locking",
                 "= \"b_bar\" has nothing to cure in plane stress, where the thickness gives way. "
                 "Leave it out.");
    formulation.locking = Formulation::Locking::b_bar;
  }
  formulation.large = table.choice("displacements", {"small", "large"}, "small") == "large";
  if (!formulation.large) return formulation;
  if (formulation.locking == Formulation::Locking::b_bar)
    table.fail("displacements", "= \"large\" and locking = \"b_bar\" do not go together yet.");
  for (const char* key : {"newmark", "generalised_alpha"})
    if (table.has(key))
      table.fail(key, "belongs to displacements = \"small\": large ones move by the midpoint rule that keeps energy and momentum. Leave it out.");
  return formulation;
}

Scheme read_scheme(const io::Table& table) {
  if (table.has("newmark") && table.has("generalised_alpha"))
    table.fail("newmark", "and generalised_alpha are both given. Keep one.");
  if (table.has("generalised_alpha")) {
    constexpr io::Range radii{
        0, 1, false, false,
        "It is the spectral radius at the highest frequencies: 1 damps nothing, 0 all of them."};
    return Scheme::generalised_alpha(
        table.table("generalised_alpha").number("spectral_radius", radii));
  }
  if (!table.has("newmark")) return {};
  const auto newmark = table.table("newmark");
  try {
    return Scheme::newmark(newmark.number("beta", io::positive, 0.25),
                           newmark.number("gamma", io::positive, 0.5));
  } catch (const std::invalid_argument& error) {
    table.fail("newmark", error.what());
  }
}

std::optional<Settings::Motion> read_motion(const io::Table& table) {
  if (table.choice("analysis", {"static", "dynamic"}, "static") == "static") {
    for (const char* key : {"newmark", "generalised_alpha", "rayleigh", "step", "start"})
      if (table.has(key)) table.fail(key, "belongs to analysis = \"dynamic\".");
    return std::nullopt;
  }
  Settings::Motion motion;
  motion.scheme = read_scheme(table);
  const auto rayleigh = table.table_or_empty("rayleigh");
  motion.damping = {rayleigh.number("mass", io::non_negative, 0.0),
                    rayleigh.number("stiffness", io::non_negative, 0.0)};
  motion.step = table.optional_number("step", io::positive);
  motion.from_equilibrium =
      table.choice("start", {"equilibrium", "rest"}, "equilibrium") == "equilibrium";
  return motion;
}

/// In 2D about z.
std::vector<Settings::Torque> read_torques(const io::Table& output, const Settings& settings) {
  std::vector<Settings::Torque> torques;
  if (!output.has("torque")) return torques;
  for (const auto& [name, table] : output.table("torque").named_tables()) {
    Settings::Torque torque{name, table.has("about") ? table.vector("about", settings.dimension) : Vec3(Vec3::Zero()), Vec3::UnitZ()};
    if (settings.dimension == 3) {
      torque.axis = table.vector("axis", 3);
      if (!(torque.axis.norm() > 0)) table.fail("axis", "has no length. Give a direction, e.g. [0, 0, 1].");
      torque.axis.normalize();
    }
    torques.push_back(torque);
  }
  return torques;
}

std::vector<Settings::Probe> read_probes(const io::Table& output, int dimension) {
  std::vector<Settings::Probe> probes;
  if (!output.has("point")) return probes;
  for (const auto& [name, table] : output.table("point").named_tables())
    probes.push_back({table, name, table.vector("at", dimension), table.flag("stress", false)});
  return probes;
}

void check_densities(const Settings& settings) {
  if (!settings.motion) return;
  for (const auto& [table, group, material] : settings.materials)
    if (!material.density) table.fail("has no density [kg/m3], which a dynamic structure needs.");
}

}  // namespace

Settings read_settings(const io::Table& root, const std::string& name) {
  const auto table = root.table(name);
  table.skip("solver");
  Settings settings(name, table);
  settings.dimension = static_cast<int>(root.integer("dimension", 2, 3));
  settings.motion = read_motion(table);
  settings.formulation = read_formulation(table, settings.dimension);
  settings.mesh = read_mesh_choice(table, settings.dimension);
  settings.degree = static_cast<int>(table.integer("degree", 1, 2, 2));
  settings.materials = read_materials(table, settings);
  check_densities(settings);
  settings.foundations = read_foundations(table, settings.mesh.groups, settings.dimension);
  if (!settings.foundations.empty() && (settings.motion || settings.formulation.large))
    table.fail("foundation", settings.motion ? "is there for analysis = \"static\" alone. Model the ground as a second material, or leave it out."
                                             : "is there for displacements = \"small\" alone. Model the ground as a second material, or leave it out.");
  settings.supports = read_supports(table, settings);
  settings.loads = read_loads(table, settings.mesh.groups, settings.dimension);
  settings.solver = read_solver(table);
  settings.processes = static_cast<int>(table.integer("processes", 1, 4096, 1));
  const auto output = table.table_or_empty("output");
  settings.vtu = output.flag("vtu", true);
  settings.hdf5 = output.flag("hdf5", false);
  settings.every = output.optional_number("every", io::positive);
  settings.von_mises = output.flag("von_mises", !settings.motion);
  settings.energy = output.flag("energy", false);
  settings.probes = read_probes(output, settings.dimension);
  settings.torques = read_torques(output, settings);
  settings.reactions = output.flag("reactions", false);
  settings.frequencies = static_cast<std::size_t>(output.integer("frequencies", 1, 1000, 0));
  if (settings.frequencies > 0)
    for (const auto& [part, group, material] : settings.materials)
      if (!material.density) part.fail("has no density [kg/m3], which natural frequencies need.");
  settings.condition = output.flag("condition", false);
  if (settings.condition && settings.formulation.large)
    output.fail("condition", "belongs to displacements = \"small\": large ones have another matrix in every iteration.");
  if (settings.energy && !settings.motion)
    output.fail("energy", "belongs to analysis = \"dynamic\".");
  table.reject_unknown();
  return settings;
}

}  // namespace acopla::fem
