#include "fem/loads.h"

#include <fmt/format.h>

#include <stdexcept>

#include "fem/faces.h"

namespace acopla::fem {
namespace {

constexpr std::pair<const char*, Load::Kind> kinds[] = {{"pressure", Load::Kind::pressure},
                                                        {"traction", Load::Kind::traction},
                                                        {"force", Load::Kind::force},
                                                        {"line_force", Load::Kind::line_force},
                                                        {"point_force", Load::Kind::point_force}};

/// ∫ N_a t dA for a traction t(point). @param factor  multiplies all
template <class Traction>
void add_traction(const Mesh& mesh, const std::vector<BoundaryFace>& faces, double factor,
                  const Traction& traction, Vector& result) {
  for (const auto& face : faces)
    visit_face(mesh, face, [&](const FacePoint& point) {
      const Vec3 force = factor * traction(point);
      for (int a = 0; a < point.shape.size(); ++a)
        add_at(result, face.nodes[static_cast<std::size_t>(a)], mesh.dimension(),
               point.shape[a] * force);
    });
}

Load read_load(const io::Table& table, const std::vector<PhysicalGroup>& groups, int dimension) {
  Load load(table);
  std::string found;
  for (const auto& [key, kind] : kinds) {
    if (!table.has(key)) continue;
    if (!found.empty())
      table.fail(key, fmt::format("and {} are both given. Make two loads of them.", found));
    found = key;
    load.kind = kind;
  }
  if (found.empty())
    table.fail("says no load. Give it a pressure, traction, force, line_force or point_force.");
  if (load.kind == Load::Kind::pressure)
    load.value[0] = table.number("pressure");
  else
    load.value = table.vector(found, dimension);
  if (load.kind == Load::Kind::line_force && dimension == 2)
    table.fail("line_force",
               "acts along edges of a solid; in 2D give a traction [N/m2] or a point_force [N].");
  if (load.kind == Load::Kind::point_force && table.has("at"))
    load.at = table.vector("at", dimension);
  else
    load.part = read_part(table, groups, dimension,
                          load.kind == Load::Kind::line_force    ? 1
                          : load.kind == Load::Kind::point_force ? 0
                                                                 : dimension - 1);
  load.amplitude = read_amplitude(table);
  return load;
}

void add_point_force(const Load& load, const Mesh& mesh, Vector& result) {
  std::vector<std::uint32_t> nodes;
  if (load.at) {
    nodes = {mesh.nearest_node(*load.at)};
    const double distance = (mesh.points()[nodes[0]] - *load.at).norm();
    if (distance > 0.1 * mesh.extent())
      load.table.fail("at",
                      fmt::format("is {:.3g} m away from the nearest node of the mesh.", distance));
  } else {
    nodes = load.part.places(mesh);
  }
  for (const auto node : nodes) add_at(result, node, mesh.dimension(), load.value);
}

}  // namespace

std::vector<Load> read_loads(const io::Table& structure, const std::vector<PhysicalGroup>& groups,
                             int dimension) {
  std::vector<Load> loads;
  if (!structure.has("load")) return loads;
  for (const auto& [name, table] : structure.table("load").named_tables())
    loads.push_back(read_load(table, groups, dimension));
  return loads;
}

void Loads::add(Vector nodal, const Amplitude& amplitude) {
  if (amplitude.constant())
    constant_ += amplitude.value(0) * nodal;
  else
    varying_.push_back({std::move(nodal), amplitude});
}

Vector Loads::at(double time) const {
  Vector result = constant_;
  for (const auto& [nodal, amplitude] : varying_) result += amplitude.value(time) * nodal;
  return result;
}

Vector Loads::mean(double start, double end) const {
  Vector result = constant_;
  for (const auto& [nodal, amplitude] : varying_) result += amplitude.mean(start, end) * nodal;
  return result;
}

Vector nodal_forces(const Load& load, const Mesh& mesh, const Formulation& formulation) {
  const double depth = mesh.dimension() == 2 ? formulation.thickness : 1;
  Vector result = mesh.zero();
  try {
    switch (load.kind) {
      case Load::Kind::pressure:
        add_traction(
            mesh, load.part.faces(mesh), -load.value[0] * depth,
            [](const FacePoint& p) { return p.area; }, result);
        break;
      case Load::Kind::traction:
        add_traction(
            mesh, load.part.faces(mesh), depth,
            [&](const FacePoint& p) { return Vec3(p.area.norm() * load.value); }, result);
        break;
      case Load::Kind::force: {
        const auto faces = load.part.faces(mesh);
        add_traction(
            mesh, faces, 1 / measure(mesh, faces),
            [&](const FacePoint& p) { return Vec3(p.area.norm() * load.value); }, result);
        break;
      }
      case Load::Kind::line_force:
        add_traction(
            mesh, load.part.curves(mesh), 1,
            [&](const FacePoint& p) { return Vec3(p.area.norm() * load.value); }, result);
        break;
      case Load::Kind::point_force:
        add_point_force(load, mesh, result);
        break;
    }
  } catch (const std::invalid_argument& error) {
    load.table.fail(error.what());
  }
  return result;
}

}  // namespace acopla::fem
