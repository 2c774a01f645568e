// Rigid-body modes, for preconditioners: what an elastic body does not resist.
#pragma once

#include <span>
#include <vector>

#include "fem/mesh.h"

namespace Teuchos {
class ParameterList;
}

namespace acopla::fem {

/// At the unknowns of some nodes, mode after mode: moves, then turns (about z in 2D); 0 at held ones.
/// @param fixed  one mark an unknown of these nodes
std::vector<double> rigid_modes(const Mesh& mesh, std::span<const std::uint32_t> nodes, std::span<const char> fixed);

/// Has Trilinos ML keep these modes on its coarse levels. deal.II 9.4 passes on constant modes only; ML's own list takes the turns as well.
/// @param modes  ML keeps the pointer
void set_rigid_modes(Teuchos::ParameterList& list, int dimension, std::vector<double>& modes);

}  // namespace acopla::fem
