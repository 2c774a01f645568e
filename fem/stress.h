// Stresses from displacements.
#pragma once

#include "fem/formulation.h"
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
Vec3 principal(const StressVector& stress);    ///< descending [Pa]

/// Stress recovery on one mesh. Keeps the inverse Jacobians of the stress points (72 bytes a point
/// in 3D), so that a window costs two small products a cell. The mesh must outlive it.
class Stress {
 public:
  Stress(const Mesh& mesh, Materials materials, const Formulation& formulation = {});

  /// Largest von Mises stress over the stress points of all cells. @param u  displacements [m]
  Peak peak(const Vector& u) const;
  /// Stress at each stress point of a cell, [6, point]; in plane strain σ_zz is what keeps the
  /// strain there zero.
  Eigen::Matrix<double, 6, Eigen::Dynamic> at_points(std::size_t cell, const Vector& u) const;
  /// Stress at each node [Pa], [6, node]: extrapolated from the stress points and averaged over the
  /// cells that meet there.
  Eigen::Matrix<double, 6, Eigen::Dynamic> nodal(const Vector& u) const;
  /// The same at one node; `cells` are those that meet there.
  StressVector at_node(std::uint32_t node, const std::vector<std::size_t>& cells,
                       const Vector& u) const;
  /// Von Mises stress of nodal() at each node [Pa].
  Vector nodal_von_mises(const Vector& u) const;

 private:
  template <int d>
  Eigen::Matrix<double, 6, Eigen::Dynamic> stress(std::size_t cell, const Vector& u) const;
  template <int d>
  Eigen::VectorXd projected_divergence(std::size_t cell,
                                       const Eigen::Matrix<double, d, Eigen::Dynamic>& moved) const;

  const Mesh& mesh_;
  Materials materials_;
  Formulation formulation_;
  std::vector<double> inverse_jacobians_;
};

}  // namespace acopla::fem
