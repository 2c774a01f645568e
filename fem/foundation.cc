#include "fem/foundation.h"

#include <stdexcept>

#include "fem/faces.h"

namespace acopla::fem {
namespace {

/// Normals this small are round-off: a plane face along an axis gives no spring across it.
constexpr double no_normal = 1e-9;

std::vector<BoundaryFace> faces_of(const Foundation& foundation, const Mesh& mesh) {
  try {
    return foundation.part.faces(mesh);
  } catch (const std::invalid_argument& error) {
    foundation.table.fail(error.what());
  }
}

/// Springs of one quadrature point [N/m].
Eigen::Matrix3d springs(const Foundation& foundation, const FacePoint& point, double depth) {
  const double area = point.area.norm(), k = foundation.stiffness * depth;
  if (foundation.all_directions) return k * area * Eigen::Matrix3d::Identity();
  return k / area * point.area * point.area.transpose();
}

double depth(const Mesh& mesh, const Formulation& formulation) { return mesh.dimension() == 2 ? formulation.thickness : 1; }

}  // namespace

std::vector<Foundation> read_foundations(const io::Table& structure, const std::vector<PhysicalGroup>& groups, int dimension) {
  std::vector<Foundation> foundations;
  if (!structure.has("foundation")) return foundations;
  for (const auto& [name, table] : structure.table("foundation").named_tables()) {
    Foundation foundation(table);
    foundation.stiffness = table.number("stiffness", io::positive);
    foundation.all_directions = table.choice("directions", {"normal", "all"}, "normal") == "all";
    foundation.part = read_part(table, groups, dimension, dimension - 1);
    foundations.push_back(std::move(foundation));
  }
  return foundations;
}

void add_stiffness(const Foundation& foundation, const Mesh& mesh, const Formulation& formulation, BlockMatrix& stiffness) {
  const int d = mesh.dimension();
  for (const auto& face : faces_of(foundation, mesh)) {
    const auto nodes = face.used();
    const auto count = static_cast<int>(nodes.size());
    Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(d * count, d * count);
    visit_face(mesh, face, [&](const FacePoint& point) {
      const Eigen::Matrix3d k = springs(foundation, point, depth(mesh, formulation));
      for (int a = 0; a < count; ++a)
        for (int b = 0; b < count; ++b) matrix.block(d * a, d * b, d, d) += point.shape[a] * point.shape[b] * k.topLeftCorner(d, d);
    });
    stiffness.add(nodes, matrix);
  }
}

void add_forces(const Foundation& foundation, const Mesh& mesh, const Formulation& formulation, const Vector& displacement, Vector& forces) {
  for (const auto& face : faces_of(foundation, mesh))
    visit_face(mesh, face, [&](const FacePoint& point) {
      Vec3 moved = Vec3::Zero();
      for (int a = 0; a < point.shape.size(); ++a)
        moved += point.shape[a] * value_at(displacement, face.nodes[static_cast<std::size_t>(a)], mesh.dimension());
      const Vec3 pull = -springs(foundation, point, depth(mesh, formulation)) * moved;
      for (int a = 0; a < point.shape.size(); ++a) add_at(forces, face.nodes[static_cast<std::size_t>(a)], mesh.dimension(), point.shape[a] * pull);
    });
}

void mark(const Foundation& foundation, const Mesh& mesh, Fixed& held) {
  const auto d = static_cast<std::size_t>(mesh.dimension());
  for (const auto& face : faces_of(foundation, mesh))
    visit_face(mesh, face, [&](const FacePoint& point) {
      for (std::size_t k = 0; k < d; ++k)
        if (foundation.all_directions || std::abs(point.area[static_cast<int>(k)]) > no_normal * point.area.norm())
          for (const auto node : face.used()) held[d * node + k] = 1;
    });
}

}  // namespace acopla::fem
