// Nodes that hang: cells that touch without sharing their nodes.
#pragma once

#include <optional>

#include "fem/mesh.h"

namespace acopla::fem {

/// A corner of one boundary face in the middle of an edge, or of a face, that it is no corner of: the cells of a finer part
/// touch those of a coarser one there, and nothing holds them together. Costs some microseconds a face of the boundary.
/// @return where, or empty when there is none
std::optional<Vec3> hanging_node(const Mesh& mesh);

}  // namespace acopla::fem
