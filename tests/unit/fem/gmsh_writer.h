// Meshes for the tests: blocks of cells, written as gmsh files with named physical groups.
#pragma once

#include <array>
#include <functional>
#include <string>

#include "geometry/surface_mesh.h"

namespace acopla::fem::test {

using geometry::Vec3;

struct Block {
  Vec3 size{1, 1, 1};                 ///< [m]; one corner is the origin
  std::array<int, 3> cells{2, 2, 2};  ///< along x, y, z
  bool tetrahedra = false;            ///< six a hexahedron
  double version = 4.1;               ///< of the format, 2.2 or 4.1
  int order = 1;                      ///< of the elements: 2 has nodes in the middles, in gmsh's order
  bool two_solids = false;  ///< the cells of the upper half along x are "other" instead of "solid"
  /// Moves the nodes; identity unless given.
  std::function<Vec3(const Vec3&)> move = [](const Vec3& p) { return p; };
};

/// Writes the block to a file in the test's folder. Its sides are the physical surfaces "x0", "x1",
/// "y0", …, "z1"; the volume is "solid". "edge" is a physical curve without elements, "ridge" the
/// edge x = z = top, and "corner" the point of the largest x, y, z.
/// @return the path
std::string write_block(const std::string& name, const Block& block = {});

/// Moves the nodes inside the unit cube by up to a tenth of their spacing of 1/2 or less, and those
/// on its sides within their side.
Vec3 distort(const Vec3& p);

/// Writes text to a file in the test's folder. @return the path
std::string write_file(const std::string& name, const std::string& text);

}  // namespace acopla::fem::test
