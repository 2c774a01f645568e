// Natural frequencies of a structure.
#pragma once

#include <vector>

#include "fem/block_matrix.h"
#include "fem/linear_solver.h"
#include "fem/mesh.h"
#include "fem/supports.h"

namespace acopla::fem {

struct Mode {
  double frequency = 0;  ///< [Hz]
  Vector shape;  ///< displacement of the free vibration, mass-normalised: φᵀ M φ = 1 [kg^(-1/2)]
};

/// The lowest modes of K φ = ω² M φ, ascending, by Lanczos iterations on K⁻¹ M (ARPACK through
/// deal.II).
/// @param fixed  must leave no rigid motion free
/// @throws std::runtime_error when the iterations do not converge; std::invalid_argument when more
/// are asked for than a quarter of the free unknowns
std::vector<Mode> natural_modes(const Mesh& mesh, const BlockMatrix& stiffness,
                                const MassMatrix& mass, const Fixed& fixed, std::size_t count,
                                const SolverOptions& options);

}  // namespace acopla::fem
