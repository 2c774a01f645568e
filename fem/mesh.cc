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

template <int d>
using Cell = typename dealii::DoFHandler<d>::active_cell_iterator;
template <int d>
using Face = typename dealii::DoFHandler<d>::face_iterator;
using geometry::FaceKind;

[[noreturn]] void fail(const std::string& name, const std::string& sentence) {
  throw io::UserError(name + ": " + sentence);
}

/// Hands cells to deal.II, which counts the corners of quadrilaterals and hexahedra
/// lexicographically.
template <int d>
void build(const MeshSource& source, dealii::Triangulation<d>& triangulation) {
  static constexpr std::size_t order[] = {0, 1, 3, 2, 4, 5, 7, 6};
  const auto& mesh = source.mesh;
  std::vector<dealii::Point<d>> points;
  for (const auto& p : mesh.points) {
    dealii::Point<d> point;
    for (unsigned c = 0; c < d; ++c) point[c] = p[static_cast<int>(c)];
    points.push_back(point);
  }
  std::vector<dealii::CellData<d>> cells;
  for (const auto& corners : mesh.cells) {
    dealii::CellData<d> cell(static_cast<unsigned>(mesh.corners()));
    for (std::size_t i = 0; i < cell.vertices.size(); ++i)
      cell.vertices[i] = corners[mesh.simplex ? i : order[i]];
    cells.push_back(std::move(cell));
  }
  try {
    if (!mesh.simplex) dealii::GridTools::consistently_order_cells(cells);
    triangulation.create_triangulation(points, cells, {});
  } catch (const std::exception& error) {
    fail(source.name, "cannot be used as a mesh: " + first_line(error));
  }
}

template <class FaceIterator>
FaceKey key_of(const FaceIterator& face) {
  FaceKey key;
  key.fill(no_corner);
  for (unsigned v = 0; v < face->n_vertices() && v < key.size(); ++v) key[v] = face->vertex_index(v);
  std::sort(key.begin(), key.end());
  return key;
}

/// Node in the middle of the edge between two vertices.
std::uint32_t middle(const Face<3>& face, unsigned from, unsigned to) {
  for (unsigned l = 0; l < face->n_lines(); ++l) {
    const auto line = face->line(l);
    const unsigned a = line->vertex_index(0), b = line->vertex_index(1);
    if ((a == from && b == to) || (a == to && b == from)) return line->dof_index(0);
  }
  throw std::logic_error("two corners of a face share no edge");
}

/// Corners of a face around it; deal.II counts those of a quadrilateral lexicographically.
std::vector<unsigned> ring(const Cell<3>& cell, const Face<3>& face) {
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

BoundaryFace make_face(const Cell<3>& cell, const Face<3>& face, int degree) {
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

/// The body is on the left of a line of its boundary.
BoundaryFace make_face(const Cell<2>& cell, const Face<2>& face, int degree) {
  const auto along = face->vertex(1) - face->vertex(0), inward = cell->center() - face->center();
  const bool turn = along[0] * inward[1] - along[1] * inward[0] < 0;
  BoundaryFace result{degree == 1 ? FaceKind::line2 : FaceKind::line3, {}};
  result.nodes[0] = face->vertex_dof_index(turn ? 1 : 0, 0);
  result.nodes[1] = face->vertex_dof_index(turn ? 0 : 1, 0);
  if (degree == 2) result.nodes[2] = face->dof_index(0);
  return result;
}

/// Coordinates of a node of a cell whose edges are straight in them: (bi-, tri-)linear between the
/// corners.
Vec3 interpolate(const std::array<Vec3, 8>& corners, const Eigen::VectorXd& at) {
  Vec3 sum = Vec3::Zero();
  const unsigned d = static_cast<unsigned>(at.size());
  for (unsigned v = 0; v < (1u << d); ++v) {
    double weight = 1;
    for (unsigned c = 0; c < d; ++c)
      weight *= (v >> c & 1) ? at[static_cast<int>(c)] : 1 - at[static_cast<int>(c)];
    sum += weight * corners[v];
  }
  return sum;
}

/// A cell's parameters in deal.II's order of its corners.
template <int d>
std::array<Vec3, 8> parameters_of(const MeshSource& source, std::size_t index,
                                  const Cell<d>& cell) {
  std::array<Vec3, 8> result;
  const auto& corners = source.mesh.cells[index];
  for (unsigned v = 0; v < cell->n_vertices(); ++v) {
    const auto found =
        std::find(corners.begin(), corners.end(), cell->vertex_index(v)) - corners.begin();
    result[v] = source.parameters[index][static_cast<std::size_t>(found)];
  }
  return result;
}

}  // namespace

Mesh::Mesh(MeshSource source, int degree)
    : name_(source.name),
      groups_(std::move(source.groups)),
      boundaries_(std::move(source.mesh.boundaries)),
      curves_(std::move(source.mesh.curves)),
      solids_(std::move(source.mesh.solids)),
      places_(std::move(source.mesh.places)),
      element_(source.mesh.dimension, source.mesh.simplex, degree),
      curved_(degree == 2 && (source.place || !source.mesh.middles.empty())) {
  with_dimension(dimension(), [&](auto d) {
    discretise<d>(source);
    number_nodes<d>(source);
  });
  measure();
}

Mesh::Mesh(Mesh&&) noexcept = default;
Mesh& Mesh::operator=(Mesh&&) noexcept = default;
Mesh::~Mesh() = default;

template <int d>
void Mesh::discretise(const MeshSource& source) {
  dealii::deal_II_exceptions::disable_abort_on_exception();  // debug builds: throw, as release does
  auto result = std::make_unique<Discretisation<d>>();
  build<d>(source, result->triangulation);
  result->element = make_element<d>(element_.simplex, element_.degree);
  result->mapping = std::make_unique<dealii::MappingFE<d>>(*make_element<d>(element_.simplex, 1));
  result->nodes.reinit(result->triangulation);
  result->nodes.distribute_dofs(*result->element);
  if constexpr (d == 2)
    plane_ = std::move(result);
  else
    space_ = std::move(result);
}

/// Nodes of second order where a mesh of that order has them.
template <class CellIterator>
void Mesh::place_middles(const GmshMesh& mesh, std::size_t index, const CellIterator& cell) {
  const auto place = [&](const auto& part) {
    const auto found = mesh.middles.find(key_of(part));
    if (found != mesh.middles.end()) points_[part->dof_index(0)] = found->second;
  };
  for (unsigned l = 0; l < cell->n_lines(); ++l) place(cell->line(l));
  if (element_.simplex) return;
  if constexpr (CellIterator::AccessorType::dimension == 3)
    for (const unsigned f : cell->face_indices()) place(cell->face(f));
  if (!mesh.centres.empty()) points_[cell->dof_index(0)] = mesh.centres[index];
}

template <int d>
void Mesh::number_nodes(const MeshSource& source) {
  const auto& [triangulation, element, mapping, handler] = discretisation<d>();
  std::vector<dealii::Point<d>> support(handler.n_dofs());
  dealii::DoFTools::map_dofs_to_support_points(*mapping, handler, support);
  points_.assign(support.size(), Vec3::Zero());
  for (std::size_t n = 0; n < support.size(); ++n)
    for (unsigned c = 0; c < d; ++c) points_[n][static_cast<int>(c)] = support[n][c];
  std::vector<dealii::types::global_dof_index> nodes(static_cast<std::size_t>(element_.nodes));
  cell_nodes_.reserve(nodes.size() * triangulation.n_active_cells());
  node_of_vertex_.resize(triangulation.n_vertices());
  std::size_t index = 0;
  for (const auto& cell : handler.active_cell_iterators()) {
    cell->get_dof_indices(nodes);
    cell_nodes_.insert(cell_nodes_.end(), nodes.begin(), nodes.end());
    for (unsigned v = 0; v < cell->n_vertices(); ++v)
      node_of_vertex_[cell->vertex_index(v)] = cell->vertex_dof_index(v, 0);
    if (source.place) {
      const auto parameters = parameters_of<d>(source, index, cell);
      for (std::size_t a = 0; a < nodes.size(); ++a)
        points_[nodes[a]] =
            source.place(interpolate(parameters, element_.support.col(static_cast<int>(a))));
    }
    if (element_.degree == 2 && !source.mesh.middles.empty()) place_middles(source.mesh, index, cell);
    ++index;
  }
}

void Mesh::measure() {
  const auto& table = element_.stiffness;
  with_dimension(dimension(), [&](auto d) {
    for (std::size_t c = 0; c < cells(); ++c) {
      const auto x = positions<d>(c);
      for (std::size_t q = 0; q < table.points(); ++q) {
        const Eigen::Matrix<double, d, d> J = x * table.gradients[q];
        const double measure = J.determinant();
        if (!(measure > 0)) {
          std::ostringstream where;
          where << x.rowwise().mean().transpose();
          fail(name_, "has a cell that is folded over itself, around (" + where.str() +
                          "). Mesh it again or smooth it.");
        }
        volume_ += measure * table.weights[static_cast<int>(q)];
      }
    }
  });
}

double Mesh::extent() const {
  Vec3 low = points_.front(), high = low;
  for (const auto& p : points_) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  return (high - low).norm();
}

template <int d>
std::vector<BoundaryFace> Mesh::boundary_faces(const std::vector<FaceKey>* keys) const {
  std::vector<BoundaryFace> faces;
  for (const auto& cell : discretisation<d>().nodes.active_cell_iterators())
    for (const unsigned f : cell->face_indices())
      if (cell->face(f)->at_boundary() &&
          (!keys || std::binary_search(keys->begin(), keys->end(), key_of(cell->face(f)))))
        faces.push_back(make_face(cell, cell->face(f), element_.degree));
  return faces;
}

std::vector<BoundaryFace> Mesh::boundary() const {
  return dimension() == 2 ? boundary_faces<2>(nullptr) : boundary_faces<3>(nullptr);
}

std::vector<BoundaryFace> Mesh::boundary(const std::string& group) const {
  const std::string parts = dimension() == 2 ? "lines" : "faces";
  const auto found = boundaries_.find(find_group(groups_, group, dimension() - 1).id);
  if (found == boundaries_.end()) throw std::invalid_argument("has no " + parts + " in the mesh.");
  const auto& keys = found->second;
  const auto faces = dimension() == 2 ? boundary_faces<2>(&keys) : boundary_faces<3>(&keys);
  if (faces.size() < keys.size())
    throw std::invalid_argument("has " + std::to_string(keys.size() - faces.size()) + " of its " +
                                std::to_string(keys.size()) + " " + parts +
                                " inside the solid or apart from it. Only " + parts +
                                " on the boundary can be used.");
  return faces;
}

std::vector<BoundaryFace> Mesh::curve(const std::string& group) const {
  const auto found = curves_.find(find_group(groups_, group, 1).id);
  if (found == curves_.end()) throw std::invalid_argument("has no edges in the mesh.");
  std::map<FaceKey, BoundaryFace> edges;
  const auto& keys = found->second;
  for (const auto& cell : space_->nodes.active_cell_iterators())
    for (unsigned l = 0; l < cell->n_lines(); ++l) {
      const auto line = cell->line(l);
      const auto key = key_of(line);
      if (!std::binary_search(keys.begin(), keys.end(), key)) continue;
      BoundaryFace edge{element_.degree == 1 ? FaceKind::line2 : FaceKind::line3, {}};
      for (unsigned v = 0; v < 2; ++v) edge.nodes[v] = node_of_vertex_[line->vertex_index(v)];
      if (element_.degree == 2) edge.nodes[2] = line->dof_index(0);
      edges.emplace(key, edge);
    }
  if (edges.size() < keys.size())
    throw std::invalid_argument("has " + std::to_string(keys.size() - edges.size()) + " of its " +
                                std::to_string(keys.size()) + " edges apart from the solid.");
  std::vector<BoundaryFace> result;
  for (const auto& [key, edge] : edges) result.push_back(edge);
  return result;
}

std::vector<std::uint32_t> Mesh::places(const std::string& group) const {
  const auto found = places_.find(find_group(groups_, group, 0).id);
  if (found == places_.end()) throw std::invalid_argument("has no points in the mesh.");
  std::vector<std::uint32_t> nodes;
  for (const auto vertex : found->second) {
    if (vertex == no_corner)
      throw std::invalid_argument(
          "has a point that is no corner of a cell. Embed it in the solid.");
    nodes.push_back(node_of_vertex_[vertex]);
  }
  return nodes;
}

const std::vector<std::uint32_t>& Mesh::solid(const std::string& group) const {
  const auto found = solids_.find(find_group(groups_, group, dimension()).id);
  if (found == solids_.end()) throw std::invalid_argument("has no cells in the mesh.");
  return found->second;
}

std::uint32_t Mesh::nearest_node(const Vec3& point) const {
  const auto nearest =
      std::min_element(points_.begin(), points_.end(), [&](const Vec3& a, const Vec3& b) {
        return (a - point).squaredNorm() < (b - point).squaredNorm();
      });
  return static_cast<std::uint32_t>(nearest - points_.begin());
}

}  // namespace acopla::fem
