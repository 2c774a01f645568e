// Which of several surfaces each point of one belongs to.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "geometry/surface_mesh.h"

namespace acopla::coupler {

/// Shares the points of `from` among the surfaces `to`: each belongs to the one with the nearest face, the first of those that are as near.
/// @param max_distance  [m] a point farther than this from all of them belongs to none
/// @return for every surface of `to`, one value per point of `from`: 1 where the point belongs to it, else 0; a point of none is given to the
/// first, whose mapping will find no partner for it and count it
std::vector<std::vector<char>> share_points(const geometry::SurfaceMesh& from, std::span<const geometry::SurfaceMesh* const> to, double max_distance);

}  // namespace acopla::coupler
