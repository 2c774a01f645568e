// Linear elasticity in three dimensions: stiffness and weight.
#pragma once

#include "fem/block_matrix.h"
#include "fem/material.h"
#include "fem/mesh.h"

namespace acopla::fem {

/// K_ab = ∫ λ ∇N_a ⊗ ∇N_b + μ ∇N_b ⊗ ∇N_a + μ (∇N_a · ∇N_b) I dV [N/m], of the free body: no
/// support is built in, so that K u − f is the residual at free nodes and the reaction at supported
/// ones.
BlockMatrix assemble_stiffness(const Mesh& mesh, const Material& material);

/// Nodal loads ∫ N_a ρ g dV [N] of a body of density ρ [kg/m³] in gravity g [m/s²].
Vector weight_loads(const Mesh& mesh, double density, const Vec3& gravity);

}  // namespace acopla::fem
