// Which displacements are held, and whether that is enough.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "fem/mesh.h"

namespace acopla::fem {

/// One mark an unknown (3 n + c): 1 where direction c of node n is held at zero.
using Fixed = std::vector<char>;

/// Holds the nodes of faces in the directions marked.
void hold(const std::vector<BoundaryFace>& faces, const std::array<bool, 3>& directions,
          Fixed& fixed);

/// Names the rigid-body motions that the supports leave free, per connected part of the mesh: the
/// null space of the held rows of the six rigid modes.
/// @return empty when all parts are held, else e.g. "move along z, turn about the axis along x
/// through (0, 0, 0.5)"
std::string free_motions(const Mesh& mesh, const Fixed& fixed);

}  // namespace acopla::fem
