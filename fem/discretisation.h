// The deal.II objects behind a Mesh. Only sources that call deal.II include this header.
#pragma once

#include <deal.II/dofs/dof_handler.h>
#include <deal.II/fe/fe.h>
#include <deal.II/fe/mapping.h>
#include <deal.II/grid/tria.h>

#include <memory>

namespace acopla::fem {

/// @param degree  1 or 2
std::unique_ptr<dealii::FiniteElement<3>> make_element(bool simplex, int degree);

/// One scalar degree of freedom a node: its index is the node's number, and the three displacements
/// of node n are the unknowns 3 n, 3 n + 1, 3 n + 2.
struct Discretisation {
  /// Without deal.II's own check of cells, which in 9.4 reads a tetrahedron as if it had 8 corners;
  /// Mesh checks the Jacobians.
  dealii::Triangulation<3> triangulation;
  std::unique_ptr<dealii::FiniteElement<3>> element;
  std::unique_ptr<dealii::Mapping<3>> mapping;  ///< straight edges
  dealii::DoFHandler<3> nodes;
};

}  // namespace acopla::fem
