#include "fem/mesh.h"

#include <deal.II/base/exceptions.h>
#include <deal.II/dofs/dof_tools.h>
#include <deal.II/fe/mapping_fe.h>
#include <deal.II/grid/grid_tools.h>

#include <Eigen/LU>
#include <algorithm>
#include <sstream>

#include "fem/dealii_error.h"
#include "fem/discretisation.h"
#include "io/error.h"

namespace acopla::fem {
namespace {

using Tria = dealii::Triangulation<3>;
using Cell = dealii::DoFHandler<3>::active_cell_iterator;
using Face = dealii::DoFHandler<3>::face_iterator;
using geometry::FaceKind;

[[noreturn]] void fail(const std::string& path, const std::string& sentence) {
  throw io::UserError(path + ": " + sentence);
}

/// Hands cells to deal.II, which counts the corners of a hexahedron lexicographically.
void build(const std::string& path, const GmshMesh& mesh, Tria& triangulation) {
  static constexpr std::size_t order[] = {0, 1, 3, 2, 4, 5, 7, 6};
  std::vector<dealii::Point<3>> points;
  for (const auto& p : mesh.points) points.emplace_back(p[0], p[1], p[2]);
  std::vector<dealii::CellData<3>> cells;
  for (const auto& corners : mesh.cells) {
    dealii::CellData<3> cell(mesh.simplex ? 4 : 8);
    for (std::size_t i = 0; i < cell.vertices.size(); ++i)
      cell.vertices[i] = corners[mesh.simplex ? i : order[i]];
    cells.push_back(std::move(cell));
  }
  try {
    if (!mesh.simplex) dealii::GridTools::consistently_order_cells(cells);
    triangulation.create_triangulation(points, cells, {});
  } catch (const std::exception& error) {
    fail(path, "cannot be used as a mesh: " + first_line(error));
  }
}

std::unique_ptr<Discretisation> discretise(const std::string& path, const GmshMesh& mesh,
                                           int degree) {
  dealii::deal_II_exceptions::disable_abort_on_exception();  // debug builds: throw, as release does
  auto result = std::make_unique<Discretisation>();
  build(path, mesh, result->triangulation);
  result->element = make_element(mesh.simplex, degree);
  result->mapping = std::make_unique<dealii::MappingFE<3>>(*make_element(mesh.simplex, 1));
  result->nodes.reinit(result->triangulation);
  result->nodes.distribute_dofs(*result->element);
  return result;
}

FaceKey key_of(const Face& face) {
  FaceKey key;
  key.fill(no_corner);
  for (unsigned v = 0; v < face->n_vertices(); ++v) key[v] = face->vertex_index(v);
  std::sort(key.begin(), key.end());
  return key;
}

/// Node in the middle of the edge between two vertices.
std::uint32_t middle(const Face& face, unsigned from, unsigned to) {
  for (unsigned l = 0; l < face->n_lines(); ++l) {
    const auto line = face->line(l);
    const unsigned a = line->vertex_index(0), b = line->vertex_index(1);
    if ((a == from && b == to) || (a == to && b == from)) return line->dof_index(0);
  }
  throw std::logic_error("two corners of a face share no edge");
}

/// Corners of a face around it; deal.II counts those of a quadrilateral lexicographically.
std::vector<unsigned> ring(const Cell& cell, const Face& face) {
  auto corners =
      face->n_vertices() == 4 ? std::vector<unsigned>{0, 1, 3, 2} : std::vector<unsigned>{0, 1, 2};
  const auto diagonal = face->vertex(corners[2]) - face->vertex(corners[0]);
  const auto side = corners.size() == 4 ? face->vertex(corners[3]) - face->vertex(corners[1])
                                        : face->vertex(corners[1]) - face->vertex(corners[0]);
  // Twice the area times the normal; for a triangle the factors stand the other way round.
  auto normal = dealii::cross_product_3d(diagonal, side);
  if (corners.size() == 3) normal *= -1;
  if (normal * (face->center() - cell->center()) < 0)
    std::reverse(corners.begin() + 1, corners.end());
  return corners;
}

BoundaryFace make_face(const Cell& cell, const Face& face, int degree) {
  const auto corners = ring(cell, face);
  const auto count = corners.size();
  BoundaryFace result{};
  auto* next = result.nodes.data();
  for (const auto corner : corners) *next++ = face->vertex_dof_index(corner, 0);
  if (degree == 1) {
    result.kind = count == 4 ? FaceKind::quad4 : FaceKind::triangle3;
    return result;
  }
  for (std::size_t i = 0; i < count; ++i)
    *next++ =
        middle(face, face->vertex_index(corners[i]), face->vertex_index(corners[(i + 1) % count]));
  if (count == 4) *next = face->dof_index(0);
  result.kind = count == 4 ? FaceKind::quad9 : FaceKind::triangle6;
  return result;
}

}  // namespace

Mesh::Mesh(const std::string& path, int degree) : Mesh(path, read_gmsh(path), degree) {}

Mesh::Mesh(const std::string& path, GmshMesh mesh, int degree)
    : groups_(read_physical_groups(path)),
      surfaces_(std::move(mesh.surfaces)),
      discretisation_(discretise(path, mesh, degree)),
      element_(mesh.simplex, degree) {
  number_nodes();
  measure(path);
}

Mesh::Mesh(Mesh&&) noexcept = default;
Mesh& Mesh::operator=(Mesh&&) noexcept = default;
Mesh::~Mesh() = default;

void Mesh::number_nodes() {
  const auto& handler = discretisation_->nodes;
  std::vector<dealii::Point<3>> support(handler.n_dofs());
  dealii::DoFTools::map_dofs_to_support_points(*discretisation_->mapping, handler, support);
  points_.reserve(support.size());
  for (const auto& p : support) points_.emplace_back(p[0], p[1], p[2]);
  std::vector<dealii::types::global_dof_index> nodes(static_cast<std::size_t>(element_.nodes));
  cell_nodes_.reserve(nodes.size() * discretisation_->triangulation.n_active_cells());
  for (const auto& cell : handler.active_cell_iterators()) {
    cell->get_dof_indices(nodes);
    cell_nodes_.insert(cell_nodes_.end(), nodes.begin(), nodes.end());
  }
}

void Mesh::measure(const std::string& path) {
  const auto& table = element_.stiffness;
  for (std::size_t c = 0; c < cells(); ++c) {
    const auto x = positions(c);
    for (std::size_t q = 0; q < table.points(); ++q) {
      const double measure = jacobian(x, table.gradients[q]).determinant();
      if (!(measure > 0)) {
        std::ostringstream where;
        where << x.rowwise().mean().transpose();
        fail(path, "has a cell that is folded over itself, around (" + where.str() +
                       "). Mesh it again or smooth it.");
      }
      volume_ += measure * table.weights[static_cast<int>(q)];
    }
  }
}

Eigen::Matrix3Xd Mesh::positions(std::size_t index) const {
  const auto nodes = cell(index);
  Eigen::Matrix3Xd result(3, std::ssize(nodes));
  for (std::size_t a = 0; a < nodes.size(); ++a)
    result.col(static_cast<int>(a)) = points_[nodes[a]];
  return result;
}

std::vector<BoundaryFace> Mesh::boundary(const std::string& name) const {
  const auto found = surfaces_.find(find_surface(groups_, name).id);
  if (found == surfaces_.end()) throw std::invalid_argument("has no faces in the mesh.");
  const auto& keys = found->second;
  std::vector<BoundaryFace> faces;
  for (const auto& cell : discretisation_->nodes.active_cell_iterators())
    for (const unsigned f : cell->face_indices())
      if (cell->face(f)->at_boundary() &&
          std::binary_search(keys.begin(), keys.end(), key_of(cell->face(f))))
        faces.push_back(make_face(cell, cell->face(f), element_.degree));
  if (faces.size() < keys.size())
    throw std::invalid_argument(
        "has " + std::to_string(keys.size() - faces.size()) + " of its " +
        std::to_string(keys.size()) +
        " faces inside the solid or apart from it. Only faces on the boundary can be used.");
  return faces;
}

}  // namespace acopla::fem
