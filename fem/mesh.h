// A mesh with nodes for displacements of first or second order, read from gmsh, and its named
// parts.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "fem/element.h"
#include "fem/gmsh.h"
#include "geometry/surface_mesh.h"

namespace acopla::fem {

using geometry::Vec3;
struct Discretisation;

/// A named part of a gmsh mesh.
struct PhysicalGroup {
  std::string name;
  int dimension = 0;
  int id = 0;
};

/// Reads the names of the physical groups, without reading the mesh.
/// @throws io::UserError when the file is not a gmsh mesh in ASCII
std::vector<PhysicalGroup> read_physical_groups(const std::string& path);

/// The surface group called `name`.
/// @throws std::invalid_argument  its text continues "the physical group "x"": it is not there (the
/// text lists those that are), or is no surface
const PhysicalGroup& find_surface(const std::vector<PhysicalGroup>& groups,
                                  const std::string& name);

/// A face of the boundary: its nodes in VTK's order, corners counter-clockwise seen from outside.
struct BoundaryFace {
  geometry::FaceKind kind;
  std::array<std::uint32_t, 9> nodes;
  std::span<const std::uint32_t> used() const { return {nodes.data(), geometry::nodes_of(kind)}; }
};

class Mesh {
 public:
  /// Reads gmsh 2 or 4.1 ASCII: hexahedra or tetrahedra of first order.
  /// @param degree  of the displacements, 1 or 2
  /// @throws io::UserError located at the file when it cannot be read, has no cells, mixes shapes,
  /// or has inverted cells
  Mesh(const std::string& path, int degree);
  Mesh(Mesh&&) noexcept;
  Mesh& operator=(Mesh&&) noexcept;
  ~Mesh();

  const Element& element() const { return element_; }
  std::size_t cells() const {
    return cell_nodes_.size() / static_cast<std::size_t>(element_.nodes);
  }
  std::size_t nodes() const { return points_.size(); }
  /// Position of each node [m].
  const std::vector<Vec3>& points() const { return points_; }
  /// Nodes of a cell in the element's order.
  std::span<const std::uint32_t> cell(std::size_t index) const {
    const auto n = static_cast<std::size_t>(element_.nodes);
    return {cell_nodes_.data() + index * n, n};
  }
  const std::vector<std::uint32_t>& cell_nodes() const { return cell_nodes_; }
  /// Positions of the nodes of a cell, [3, node] [m].
  Eigen::Matrix3Xd positions(std::size_t index) const;
  /// Sum of the cells' volumes [m³].
  double volume() const { return volume_; }

  const std::vector<PhysicalGroup>& groups() const { return groups_; }
  /// Faces of the boundary that belong to a surface group, in the order of the cells.
  /// @throws std::invalid_argument as find_surface, or when it has faces off the boundary
  std::vector<BoundaryFace> boundary(const std::string& group) const;

  const Discretisation& discretisation() const { return *discretisation_; }

 private:
  Mesh(const std::string& path, GmshMesh mesh, int degree);
  void number_nodes();
  void measure(const std::string& path);

  std::vector<PhysicalGroup> groups_;
  std::map<int, std::vector<FaceKey>> surfaces_;  // by the group's number
  std::unique_ptr<Discretisation> discretisation_;
  Element element_;
  std::vector<Vec3> points_;
  std::vector<std::uint32_t> cell_nodes_;
  double volume_ = 0;
};

}  // namespace acopla::fem
