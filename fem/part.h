// A part of a structure that a case names: by groups of the mesh, or by where it lies.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "fem/mesh.h"
#include "io/case_table.h"

namespace acopla::fem {

/// Faces of the boundary (of groups, in a box, or in an arc), edges or points.
struct Part {
  struct Arc {
    double from = 0, to = 0;     ///< [rad], counter-clockwise about z from the x axis
    std::optional<Vec3> centre;  ///< [m]; without one the middle of the mesh
  };
  std::vector<std::string> groups;  ///< empty: all of the boundary
  std::optional<std::pair<Vec3, Vec3>>
      box;                 ///< faces with all their nodes in it, lower and upper corner [m]
  std::optional<Arc> arc;  ///< faces with their middle in it

  // All throw std::invalid_argument as Mesh::boundary, with the group's name, or when the part
  // holds nothing.
  std::vector<BoundaryFace> faces(const Mesh& mesh) const;
  std::vector<BoundaryFace> curves(const Mesh& mesh) const;
  std::vector<std::uint32_t> places(const Mesh& mesh) const;
};

/// Reads `on` of a table: a group, a list of groups, { box = [[…], […]] } or { arc = { from, to,
/// centre, of } } (degrees); without it the group that the table is named after.
/// @param dimension  of the space; @param kind  dimension of the part, 0 to 2
/// @throws io::UserError, also for a group that the mesh does not have
Part read_part(const io::Table& table, const std::vector<PhysicalGroup>& groups, int dimension,
               int kind);

/// The nodes of faces, ascending.
std::vector<std::uint32_t> nodes_of(const std::vector<BoundaryFace>& faces);

}  // namespace acopla::fem
