#include "fem/settings.h"

#include <stdexcept>

namespace acopla::fem {
namespace {

constexpr io::Range poisson_range{-1, 0.5, true, true,
                                  "Poisson's ratio of a stable compressible solid lies there."};
constexpr double gibibyte = 1ull << 30;

void check_supported(const io::Table& root, const io::Table& table) {
  if (root.integer("dimension", 2, 3) != 3)
    root.fail("dimension", "= 2 cannot be computed by solver \"fem\" yet: it supports 3.");
  const auto analysis = table.text("analysis", "static");
  if (analysis == "dynamic")
    table.fail("analysis", "= \"dynamic\" is not there yet: solver \"fem\" supports \"static\".");
  table.choice("analysis", {"static"}, "static");
}

Material read_material(const io::Table& table) {
  Material material;
  material.young = table.number("young", io::positive);
  material.poisson = table.number("poisson", poisson_range);
  material.density = table.optional_number("density", io::positive);
  return material;
}

std::array<bool, 3> read_directions(const io::Table& fix) {
  if (!fix.has("directions")) return {true, true, true};
  std::array<bool, 3> directions{};
  for (const auto& word : fix.texts("directions")) {
    const auto axis = word.size() == 1 ? std::string("xyz").find(word) : std::string::npos;
    if (axis == std::string::npos)
      fix.fail("directions", "has \"" + word + "\"; directions are \"x\", \"y\" and \"z\".");
    directions[axis] = true;
  }
  if (directions == std::array<bool, 3>{})
    fix.fail("directions", "is empty. Leave it out to hold all directions.");
  return directions;
}

std::vector<Settings::Fix> read_fixes(const io::Table& table,
                                      const std::vector<PhysicalGroup>& groups) {
  if (!table.has("fix"))
    table.fail("has no table fix: nothing holds the structure. Add [" + table.name() +
               ".fix.SURFACE] for a physical surface of the mesh.");
  const auto parent = table.table("fix");
  std::vector<Settings::Fix> fixes;
  for (const auto& [group, fix] : parent.named_tables()) {
    try {
      find_surface(groups, group);
    } catch (const std::invalid_argument& error) {
      parent.fail(group, error.what());
    }
    fixes.push_back({group, read_directions(fix)});
  }
  return fixes;
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

}  // namespace

Settings read_settings(const io::Table& root, const std::string& name) {
  const auto table = root.table(name);
  table.skip("solver");
  check_supported(root, table);
  Settings settings{.name = name,
                    .table = table,
                    .mesh = table.path("mesh"),
                    .degree = static_cast<int>(table.integer("degree", 1, 2, 2)),
                    .material = read_material(table.table("material")),
                    .fixes = read_fixes(table, read_physical_groups(table.path("mesh"))),
                    .solver = read_solver(table),
                    .vtu = true,
                    .every = {}};
  const auto output = table.table_or_empty("output");
  settings.vtu = output.flag("vtu", true);
  settings.every = output.optional_number("every", io::positive);
  table.reject_unknown();
  return settings;
}

}  // namespace acopla::fem
