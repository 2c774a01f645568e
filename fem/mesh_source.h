// What a mesh is made from: a gmsh file, or a shape that the case describes.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "fem/gmsh.h"
#include "geometry/surface_mesh.h"

namespace acopla::fem {

/// A named part of a mesh.
struct PhysicalGroup {
  std::string name;
  int dimension = 0;
  int id = 0;
};

/// Reads the names of a gmsh file's physical groups, without reading the mesh.
/// @throws io::UserError when the file is not a gmsh mesh in ASCII
std::vector<PhysicalGroup> read_physical_groups(const std::string& path);

/// The group called `name` of the dimension asked for.
/// @throws std::invalid_argument  its text continues "the physical group "x"": it is not there (the
/// text lists those that are), or has another dimension
const PhysicalGroup& find_group(const std::vector<PhysicalGroup>& groups, const std::string& name,
                                int dimension);

struct MeshSource {
  std::string name;  ///< for messages: the file, or the shape
  GmshMesh mesh;
  std::vector<PhysicalGroup> groups;
  /// Of curved shapes: coordinates of each cell's corners in which its edges are straight (e.g.
  /// radius and angle), and where those are in space [m]. Nodes of second order are placed by them.
  /// Empty for straight edges.
  std::vector<std::array<geometry::Vec3, 8>> parameters;
  std::function<geometry::Vec3(const geometry::Vec3&)> place;

  /// @throws io::UserError as read_gmsh
  static MeshSource from_file(const std::string& path, int dimension);
};

}  // namespace acopla::fem
