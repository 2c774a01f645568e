// A mesh with nodes for displacements of first or second order, and its named parts.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "fem/element.h"
#include "fem/mesh_source.h"
#include "fem/nodal.h"
#include "geometry/surface_mesh.h"

namespace acopla::fem {

using geometry::Vec3;
template <int d>
struct Discretisation;

/// A face of the boundary, or an edge: its nodes in VTK's order, corners counter-clockwise seen
/// from outside.
struct BoundaryFace {
  geometry::FaceKind kind;
  std::array<std::uint32_t, 9> nodes;
  std::span<const std::uint32_t> used() const { return {nodes.data(), geometry::nodes_of(kind)}; }
};

/// Cells with nodes for displacements of first or second order, and their named parts. In 2D the
/// faces of the boundary are lines, and points lie in z = 0.
class Mesh {
 public:
  /// @param degree  of the displacements, 1 or 2
  /// @throws io::UserError naming the source when it has inverted cells
  Mesh(MeshSource source, int degree);
  /// Reads gmsh 2 or 4.1 ASCII. Nodes of a mesh of second order are those of displacements of second order. @throws io::UserError also when it cannot be read, has no cells, or
  /// mixes shapes
  Mesh(const std::string& path, int degree, int dimension = 3)
      : Mesh(MeshSource::from_file(path, dimension), degree) {}
  Mesh(Mesh&&) noexcept;
  Mesh& operator=(Mesh&&) noexcept;
  ~Mesh();

  int dimension() const { return element_.dimension; }
  const std::string& name() const { return name_; }
  const Element& element() const { return element_; }
  bool curved() const { return curved_; }  ///< cells of second order have curved edges
  std::size_t cells() const {
    return cell_nodes_.size() / static_cast<std::size_t>(element_.nodes);
  }
  std::size_t nodes() const { return points_.size(); }
  std::size_t unknowns() const { return points_.size() * static_cast<std::size_t>(dimension()); }
  Vector zero() const {
    return Vector::Zero(static_cast<Eigen::Index>(unknowns()));
  }  ///< a nodal field of zeros
  /// Position of each node [m].
  const std::vector<Vec3>& points() const { return points_; }
  /// Nodes of a cell in the element's order.
  std::span<const std::uint32_t> cell(std::size_t index) const {
    const auto n = static_cast<std::size_t>(element_.nodes);
    return {cell_nodes_.data() + index * n, n};
  }
  const std::vector<std::uint32_t>& cell_nodes() const { return cell_nodes_; }
  /// Positions of the nodes of a cell, [3, node] [m].
  Eigen::Matrix3Xd positions(std::size_t index) const { return positions<3>(index); }
  /// The first d components of the same.
  template <int d>
  Eigen::Matrix<double, d, Eigen::Dynamic> positions(std::size_t index) const {
    const auto nodes = cell(index);
    Eigen::Matrix<double, d, Eigen::Dynamic> result(d, std::ssize(nodes));
    for (std::size_t a = 0; a < nodes.size(); ++a)
      result.col(static_cast<int>(a)) = points_[nodes[a]].template head<d>();
    return result;
  }
  /// Sum of the cells' volumes [m³], or areas [m²] in 2D.
  double volume() const { return volume_; }
  /// Diagonal of the bounding box [m].
  double extent() const;

  const std::vector<PhysicalGroup>& groups() const { return groups_; }
  /// All faces of the boundary, in the order of the cells.
  std::vector<BoundaryFace> boundary() const;
  /// Those that belong to a group.
  /// @throws std::invalid_argument as find_group, or when it has faces off the boundary
  std::vector<BoundaryFace> boundary(const std::string& group) const;
  /// Edges of a group of curves in 3D. @throws std::invalid_argument as find_group, or when it has
  /// edges of no cell
  std::vector<BoundaryFace> curve(const std::string& group) const;
  /// Nodes of a group of points. @throws std::invalid_argument as find_group, or when it has points
  /// of no cell
  std::vector<std::uint32_t> places(const std::string& group) const;
  /// Cells of a group of volumes (surfaces in 2D), ascending. @throws std::invalid_argument as
  /// find_group
  const std::vector<std::uint32_t>& solid(const std::string& group) const;
  std::uint32_t nearest_node(const Vec3& point) const;

  template <int d>
  const Discretisation<d>& discretisation() const {
    if constexpr (d == 2)
      return *plane_;
    else
      return *space_;
  }

 private:
  template <int d>
  void discretise(const MeshSource& source);
  template <int d>
  void number_nodes(const MeshSource& source);
  template <class CellIterator>
  void place_middles(const GmshMesh& mesh, std::size_t index, const CellIterator& cell);
  template <int d>
  std::vector<BoundaryFace> boundary_faces(const std::vector<FaceKey>* keys) const;
  void measure();

  std::string name_;
  std::vector<PhysicalGroup> groups_;
  std::map<int, std::vector<FaceKey>> boundaries_, curves_;  // by the group's number
  std::map<int, std::vector<std::uint32_t>> solids_, places_;
  std::unique_ptr<Discretisation<2>> plane_;  // one of these two
  std::unique_ptr<Discretisation<3>> space_;
  Element element_;
  bool curved_ = false;
  std::vector<Vec3> points_;
  std::vector<std::uint32_t> cell_nodes_;
  std::vector<std::uint32_t> node_of_vertex_;
  double volume_ = 0;
};

}  // namespace acopla::fem
