// Linear elasticity: stiffness, mass and weight.
#pragma once

#include "fem/block_matrix.h"
#include "fem/formulation.h"
#include "fem/mesh.h"

namespace acopla::fem {

/// K_ab = ∫ λ ∇N_a ⊗ ∇N_b + μ ∇N_b ⊗ ∇N_a + μ (∇N_a · ∇N_b) I dV [N/m], of the free body: no
/// support is built in, so that K u − f is the residual at free nodes and the reaction at supported
/// ones.
BlockMatrix assemble_stiffness(const Mesh& mesh, const Materials& materials,
                               const Formulation& formulation = {});

/// The same in the rows of a pattern of one's own.
BlockMatrix assemble_stiffness(const Mesh& mesh, const Materials& materials, const Formulation& formulation, std::shared_ptr<const CoupledNodes> pattern);

/// Consistent mass ∫ ρ N_a N_b dV [kg]; a material without a density has none.
/// @param pattern  of the stiffness; only the rows that it has are there
MassMatrix assemble_mass(const Mesh& mesh, const Materials& materials,
                         const Formulation& formulation,
                         std::shared_ptr<const CoupledNodes> pattern);

/// Nodal loads ∫ N_a ρ g dV [N] in gravity g [m/s²].
Vector weight_loads(const Mesh& mesh, const Materials& materials, const Vec3& gravity,
                    const Formulation& formulation = {});

}  // namespace acopla::fem
