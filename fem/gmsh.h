// Reads the geometry of a gmsh mesh.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "geometry/surface_mesh.h"

namespace acopla::fem {

/// Corners of a face, ascending; the fourth of a triangle is no_corner.
using FaceKey = std::array<std::uint32_t, 4>;
inline constexpr std::uint32_t no_corner = ~std::uint32_t{0};

struct GmshMesh {
  std::vector<geometry::Vec3> points;  ///< [m]; corners of cells only
  bool simplex = false;                ///< tetrahedra, otherwise hexahedra
  /// Corners of each cell in gmsh's order, with positive volume; a tetrahedron uses the first four.
  std::vector<std::array<std::uint32_t, 8>> cells;
  /// Faces of each physical surface, by its number, ascending. A face may be in several groups.
  std::map<int, std::vector<FaceKey>> surfaces;
};

/// Reads gmsh 2 or 4.1 in ASCII. deal.II's own reader trusts the file (counts, node numbers, faces
/// shared by three cells), keeps one physical group a face, and ends in a crash where this one says
/// what is wrong and in which line.
/// @throws io::UserError located at the file when it is not such a mesh, has no cells, mixes
/// shapes, or has elements of second order
GmshMesh read_gmsh(const std::string& path);

}  // namespace acopla::fem
