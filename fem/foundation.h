// An elastic foundation: springs spread over a part of the boundary.
#pragma once

#include <vector>

#include "fem/block_matrix.h"
#include "fem/formulation.h"
#include "fem/part.h"
#include "fem/supports.h"

namespace acopla::fem {

/// Springs of k [N/m³] between a part of the boundary and the ground (Winkler 1867): the traction −k (n · u) n, or −k u. They pull
/// as well as push.
struct Foundation {
  explicit Foundation(io::Table of_case) : table(std::move(of_case)) {}
  io::Table table;
  Part part;
  double stiffness = 0;       ///< k [N/m³]
  bool all_directions = false;  ///< otherwise along the normal alone
};

/// Reads [NAME.foundation.…]. @throws io::UserError
std::vector<Foundation> read_foundations(const io::Table& structure, const std::vector<PhysicalGroup>& groups, int dimension);

/// K_ab += ∫ k N_a N_b (n ⊗ n or I) dA. In 2D of the structure's thickness.
/// @throws io::UserError located at the foundation when its part is not there; so do the next
void add_stiffness(const Foundation& foundation, const Mesh& mesh, const Formulation& formulation, BlockMatrix& stiffness);

/// Adds the foundation's forces on the nodes [N], whose sum and moment are those of its tractions.
void add_forces(const Foundation& foundation, const Mesh& mesh, const Formulation& formulation, const Vector& displacement, Vector& forces);

/// Marks the unknowns that springs act on: with them a body is not free.
void mark(const Foundation& foundation, const Mesh& mesh, Fixed& held);

}  // namespace acopla::fem
