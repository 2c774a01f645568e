// Stresses from displacements.
#pragma once

#include "fem/block_matrix.h"
#include "fem/material.h"
#include "fem/mesh.h"

namespace acopla::fem {

/// The largest of a scalar field and where it is.
struct Peak {
  double value = 0;
  Vec3 where = Vec3::Zero();  ///< [m]
};

/// Stress tensors in Voigt's order: xx, yy, zz, yz, xz, xy [Pa].
using StressVector = Eigen::Matrix<double, 6, 1>;

double von_mises(const StressVector& stress);  ///< [Pa]

/// Stress recovery on one mesh. Keeps the inverse Jacobians of the stress points (72 bytes a
/// point), so that a window costs two small products a cell. The mesh must outlive it.
class Stress {
 public:
  Stress(const Mesh& mesh, const Material& material);

  /// Largest von Mises stress over the stress points of all cells. @param u  displacements [m]
  Peak peak(const Vector& u) const;
  /// Stress at each stress point of a cell, [6, point].
  Eigen::Matrix<double, 6, Eigen::Dynamic> at_points(std::size_t cell, const Vector& u) const;
  /// Von Mises stress at each node [Pa], of the stress tensor extrapolated from the stress points
  /// and averaged over the cells that meet at the node.
  Vector nodal_von_mises(const Vector& u) const;

 private:
  const Mesh& mesh_;
  double lambda_, mu_;
  std::vector<Eigen::Matrix3d> inverse_jacobians_;
};

}  // namespace acopla::fem
