// Walls as a case writes them.
#pragma once

#include <string>
#include <vector>

#include "dem/wall/wall_set.h"
#include "io/case_table.h"

namespace acopla::dem {

/// Reads and checks one [X.wall.NAME] table with its [X.wall.NAME.motion], and the mesh it names.
/// @param materials  names; the wall's material is an index into them
/// @param dimension  2 or 3
/// @throws io::UserError, located
Wall read_wall(const io::Table& table, const std::string& name, const std::vector<std::string>& materials, int dimension);

}  // namespace acopla::dem
