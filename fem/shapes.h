// Meshes that a case describes instead of naming a file.
#pragma once

#include <functional>
#include <vector>

#include "fem/mesh_source.h"
#include "io/case_table.h"

namespace acopla::fem {

/// A mesh that is made when it is needed, and the groups that it will have.
struct MeshChoice {
  std::vector<PhysicalGroup> groups;
  std::function<MeshSource()> make;
};

/// Reads `mesh`: the path of a gmsh file, or a table of one shape:
///   bar       size, cells, [origin]: sides x0, x1, y0, y1, z0, z1
///   plate     as bar in 3D: top, bottom, edges
///   box       inner (size), wall (thickness), cells of the inside, [wall_cells]; open at the top:
///   inside, outside, base, rim l_bracket legs, width, [depth], cells across the width: x1 and y1
///   (the legs' ends), outer, inner, front, back annulus   inner, outer, cells (radial, around),
///   [centre, from, to]: inside, outside; of a sector start, end cylinder  as annulus with height
///   and cells along it, hollow: also z0, z1
///   disc      radius, cells around a quarter, [centre]: outside    rod  as disc with height, cells = [around a quarter, along]: also z0, z1
/// @throws io::UserError
MeshChoice read_mesh_choice(const io::Table& structure, int dimension);

}  // namespace acopla::fem
