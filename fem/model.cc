#include "fem/model.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "fem/hanging.h"

namespace acopla::fem {
namespace {

Mesh make_mesh(const Settings& settings) {
  Mesh mesh(settings.mesh.make(), settings.degree);
  if (mesh.element().simplex && settings.formulation.locking == Formulation::Locking::b_bar)
    settings.table.fail(
        "locking",
        fmt::format(
            "= \"b_bar\" needs {}; {} locks with few unknowns whatever is averaged in a cell.",
            mesh.dimension() == 2 ? "quadrilaterals" : "hexahedra",
            mesh.dimension() == 2 ? "a triangle" : "a tetrahedron"));
  if (const auto at = hanging_node(mesh))
    settings.table.fail("mesh", fmt::format("has a hanging node at ({:.4g}, {:.4g}, {:.4g}): cells of a finer part touch a coarser one there and nothing "
                                            "holds them together. Mesh the parts as one (in gmsh: fragment them, or remove duplicate faces), with cells of "
                                            "the same size where they meet.", (*at)[0], (*at)[1], (*at)[2]));
  return mesh;
}

Materials fill(const Settings& settings, const Mesh& mesh) {
  if (settings.materials.size() == 1 && settings.materials.front().group.empty())
    return settings.materials.front().material;
  constexpr std::uint16_t none = 0xffff;
  std::vector<Material> list;
  std::vector<std::uint16_t> of_cell(mesh.cells(), none);
  for (const auto& [table, group, material] : settings.materials) {
    list.push_back(material);
    try {
      for (const auto cell : mesh.solid(group)) {
        if (of_cell[cell] != none)
          table.fail(fmt::format("shares cells with {}. Each cell has one material.",
                                 settings.materials[of_cell[cell]].table.name()));
        of_cell[cell] = static_cast<std::uint16_t>(list.size() - 1);
      }
    } catch (const std::invalid_argument& error) {
      table.fail(error.what());
    }
  }
  const auto bare = std::find(of_cell.begin(), of_cell.end(), none);
  if (bare != of_cell.end()) {
    const Vec3 middle =
        mesh.positions(static_cast<std::size_t>(bare - of_cell.begin())).rowwise().mean();
    settings.table.fail(
        "material",
        fmt::format(
            "leaves {} of {} cells without one, e.g. around ({:.4g}, {:.4g}, {:.4g}). Add a "
            "material for their group.",
            std::count(of_cell.begin(), of_cell.end(), none), mesh.cells(), middle[0], middle[1],
            middle[2]));
  }
  return {std::move(list), std::move(of_cell)};
}

Supports support(const Settings& settings, const Mesh& mesh) {
  Supports supports(mesh);
  for (const auto& support : settings.supports) try {
      const auto nodes = nodes_of(support.part.faces(mesh));
      if (support.moves)
        supports.move(support.table.name(), mesh, nodes, support.directions, support.value,
                      support.history);
      else
        supports.hold(support.table.name(), mesh, nodes, support.directions);
    } catch (const std::invalid_argument& error) {
      support.table.fail(error.what());
    }
  if (settings.motion) return supports;
  Fixed held = supports.fixed();
  for (const auto& foundation : settings.foundations) mark(foundation, mesh, held);
  const auto* key = settings.table.has("fix") ? "fix" : settings.table.has("move") ? "move" : "foundation";
  require_supported(settings, mesh, held, key, "Fix another surface or more directions.");
  return supports;
}

Loads load(const Settings& settings, const Mesh& mesh, const Materials& materials,
           const Vec3& gravity) {
  Loads loads(mesh);
  loads.add(weight_loads(mesh, materials, gravity, settings.formulation));
  for (const auto& load : settings.loads)
    loads.add(nodal_forces(load, mesh, settings.formulation), load.amplitude);
  return loads;
}

}  // namespace

BlockMatrix stiffness_of(const Settings& settings, const Model& model) {
  auto stiffness = assemble_stiffness(model.mesh, model.materials, settings.formulation);
  for (const auto& foundation : settings.foundations) add_stiffness(foundation, model.mesh, settings.formulation, stiffness);
  return stiffness;
}

void require_supported(const Settings& settings, const Mesh& mesh, const Fixed& fixed,
                       const std::string& key, const std::string& advice) {
  const auto motions = free_motions(mesh, fixed);
  if (!motions.empty())
    settings.table.fail(key, "leaves the structure free to " + motions + ". " + advice);
}

Model::Model(const Settings& settings, const Vec3& gravity)
    : mesh(make_mesh(settings)),
      materials(fill(settings, mesh)),
      supports(support(settings, mesh)),
      loads(load(settings, mesh, materials, gravity)) {}

}  // namespace acopla::fem
