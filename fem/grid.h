// Meshes of cells in rows, from which the shapes of a case are made.
#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "fem/mesh_source.h"

namespace acopla::fem {

using GridIndex = std::array<int, 3>;

/// Cells (i, j, k) in rows, of which some may be left out.
struct Grid {
  std::string name = {};  ///< for messages
  int dimension = 3;
  GridIndex cells{1, 1, 1};
  bool simplices = false;  ///< each cell cut into two triangles or six tetrahedra (Kuhn)
  bool closed = false;     ///< the rows along j close: its last nodes are its first
  /// The corner that stands for a corner at the same place, where rows are joined otherwise; corners stand for themselves unless given.
  std::function<GridIndex(const GridIndex&)> joined = {};
  /// Coordinates of the corner before cell (i, j, k); in space [m] unless `place` is given.
  std::function<geometry::Vec3(const GridIndex&)> corner = {};
  /// Where the coordinates are in space [m], for curved shapes: edges are straight in the
  /// coordinates.
  std::function<geometry::Vec3(const geometry::Vec3&)> place = {};
  std::function<bool(const GridIndex&)> keep = [](const GridIndex&) { return true; };
  /// Groups of the boundary face of a cell on side 2 d (the lower along direction d) or 2 d + 1; none where rows are joined.
  std::function<std::vector<std::string>(int side, const GridIndex& cell)> sides = {};
};

/// Builds the mesh; its cells are the group "solid".
MeshSource build(const Grid& grid);

/// "x0", "x1", "y0", …: the sides of a block.
std::vector<std::string> side_name(int side, const GridIndex& cell);

}  // namespace acopla::fem
