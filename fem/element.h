// Shape functions of a cell, tabulated once on the reference cell. No deal.II here: what loops over
// cells (stiffness, stress) reads plain tables and compiles in a second.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace acopla::fem {

/// Shape functions at a set of points of the reference cell.
struct Table {
  Eigen::MatrixXd points_in_cell;  ///< [dimension, point], in the unit cell
  Eigen::VectorXd weights;         ///< of the quadrature; empty where the points are not one
  Eigen::MatrixXd values;          ///< [node, point]
  /// Gradients in reference coordinates, one [node, dimension] matrix a point.
  std::vector<Eigen::MatrixXd> gradients;
  std::size_t points() const { return gradients.size(); }
};

/// A Lagrange cell: quadrilateral or hexahedron (Q1, Q2), triangle or tetrahedron (P1, P2). Nodes
/// stand in deal.II's order.
struct Element {
  /// @param dimension  2 or 3; @param degree  1 or 2
  Element(int dimension, bool simplex, int degree);

  int dimension;
  bool simplex;
  int degree;
  int nodes = 0;
  Eigen::MatrixXd support;  ///< [dimension, node]: the nodes in the unit cell
  Table stiffness;  ///< at a quadrature that integrates the stiffness of a parallelepiped exactly
  Table mass;       ///< at one that does so for products of two shape functions
  /// At the points where the stress of the cell is most accurate: 2×2 (×2) Gauss points of a
  /// quadrilateral (hexahedron) (Barlow 1976), as many as the polynomials need of a triangle or
  /// tetrahedron.
  Table stress;
  /// [node, stress point]: the (tri)linear fit through the stress points, evaluated at the nodes.
  Eigen::MatrixXd extrapolation;

  /// Functions on which B-bar projects the volumetric strain, [function, point]: 1 in cells of
  /// first order, 1 and the reference coordinates in those of second.
  Eigen::MatrixXd volumetric(const Table& table) const;
};

}  // namespace acopla::fem
