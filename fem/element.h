// Shape functions of a cell, tabulated once on the reference cell. No deal.II here: what loops over
// cells (stiffness, stress) reads plain tables and compiles in a second.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace acopla::fem {

/// Shape functions at a set of points of the reference cell.
struct Table {
  Eigen::VectorXd weights;  ///< of the quadrature; empty where the points are not one
  Eigen::MatrixXd values;   ///< [node, point]
  /// Gradients in reference coordinates, one [node, 3] matrix a point.
  std::vector<Eigen::Matrix<double, Eigen::Dynamic, 3>> gradients;
  std::size_t points() const { return gradients.size(); }
};

/// A Lagrange cell: hexahedron (Q1, Q2) or tetrahedron (P1, P2). Nodes stand in deal.II's order.
struct Element {
  /// @param degree  1 or 2
  Element(bool simplex, int degree);

  bool simplex;
  int degree;
  int nodes = 0;
  Table stiffness;  ///< at a quadrature that integrates the stiffness of a parallelepiped exactly
  /// At the points where the stress of the cell is most accurate: 2×2×2 Gauss points of a
  /// hexahedron (Barlow 1976), as many as the polynomials need of a tetrahedron.
  Table stress;
  /// [node, stress point]: the (tri)linear fit through the stress points, evaluated at the nodes.
  Eigen::MatrixXd extrapolation;
};

/// dx/dξ [i, j] at one point.
/// @param positions  [3, node]; @param gradients  [node, 3] in reference coordinates
inline Eigen::Matrix3d jacobian(const Eigen::Matrix3Xd& positions,
                                const Eigen::Matrix<double, Eigen::Dynamic, 3>& gradients) {
  return positions * gradients;
}

}  // namespace acopla::fem
