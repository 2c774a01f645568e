// Reads the geometry of a gmsh mesh.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "geometry/surface_mesh.h"

namespace acopla::fem {

/// Corners of a face, ascending; an edge (a face in 2D) has two and a triangle three, the rest are
/// no_corner.
using FaceKey = std::array<std::uint32_t, 4>;
inline constexpr std::uint32_t no_corner = ~std::uint32_t{0};

/// Corners, cells and named parts of a mesh, whether read from a file or built.
struct GmshMesh {
  int dimension = 3;
  std::vector<geometry::Vec3> points;  ///< [m]; corners of cells only; z = 0 in 2D
  bool simplex = false;  ///< triangles or tetrahedra, otherwise quadrilaterals or hexahedra
  /// Corners of each cell in gmsh's order, with positive volume; only the first corners() count.
  std::vector<std::array<std::uint32_t, 8>> cells;
  /// Of a mesh of second order: nodes in the middles of edges (by their two corners) and of quadrilateral faces (by four) [m], and of
  /// cells, one each; empty where cells have none.
  std::map<FaceKey, geometry::Vec3> middles;
  std::vector<geometry::Vec3> centres;
  // Parts by the number of their physical group, each ascending. A part may be in several groups.
  std::map<int, std::vector<std::uint32_t>> solids;  ///< cells
  std::map<int, std::vector<FaceKey>> boundaries;    ///< faces: of dimension − 1
  std::map<int, std::vector<FaceKey>> curves;        ///< edges of a mesh in 3D
  std::map<int, std::vector<std::uint32_t>> places;  ///< points

  std::size_t corners() const { return dimension == 2 ? (simplex ? 3 : 4) : (simplex ? 4 : 8); }
};

/// Reads gmsh 2 or 4.1 in ASCII. deal.II's own reader trusts the file (counts, node numbers, faces
/// shared by three cells), keeps one physical group a face, and ends in a crash where this one says
/// what is wrong and in which line.
/// @param dimension  of the structure: in 2D the cells are the mesh's triangles or quadrilaterals,
/// which lie in z = 0
/// @throws io::UserError located at the file when it is not such a mesh, has no cells, mixes
/// shapes, or has elements of an order above the second or without all nodes of it
GmshMesh read_gmsh(const std::string& path, int dimension = 3);

}  // namespace acopla::fem
