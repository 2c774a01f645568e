// The deal.II objects behind a Mesh. Only sources that call deal.II include this header.
#pragma once

#include <deal.II/dofs/dof_handler.h>
#include <deal.II/fe/fe.h>
#include <deal.II/fe/mapping.h>
#include <deal.II/grid/tria.h>

#include <memory>

namespace acopla::fem {

/// @param degree  1 or 2
template <int d>
std::unique_ptr<dealii::FiniteElement<d>> make_element(bool simplex, int degree);

/// One scalar degree of freedom a node: its index is the node's number, and the displacements of
/// node n are the unknowns d n, …, d n + d − 1.
template <int d>
struct Discretisation {
  /// Without deal.II's own check of cells, which in 9.4 reads a tetrahedron as if it had 8 corners;
  /// Mesh checks the Jacobians.
  dealii::Triangulation<d> triangulation;
  std::unique_ptr<dealii::FiniteElement<d>> element;
  std::unique_ptr<dealii::Mapping<d>> mapping;  ///< straight edges
  dealii::DoFHandler<d> nodes;
};

}  // namespace acopla::fem
