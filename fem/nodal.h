// Values at the nodes of a mesh: displacements, velocities, forces.
#pragma once

#include <Eigen/Core>
#include <cmath>

namespace acopla::fem {

/// Values at nodes, d = 2 or 3 a node as the dimension of the mesh: entry d n + c is direction c of
/// node n.
using Vector = Eigen::VectorXd;

/// The value of a node; its third component is 0 in 2D.
inline Eigen::Vector3d value_at(const Vector& nodal, std::size_t node, int dimension) {
  Eigen::Vector3d value = Eigen::Vector3d::Zero();
  for (int c = 0; c < dimension; ++c)
    value[c] = nodal[dimension * static_cast<Eigen::Index>(node) + c];
  return value;
}

/// Adds to the value of a node; a third component is dropped in 2D.
inline void add_at(Vector& nodal, std::size_t node, int dimension, const Eigen::Vector3d& value) {
  for (int c = 0; c < dimension; ++c)
    nodal[dimension * static_cast<Eigen::Index>(node) + c] += value[c];
}

/// Sum over all nodes, e.g. of nodal forces [N].
inline Eigen::Vector3d total(const Vector& nodal, int dimension) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int c = 0; c < dimension; ++c)
    sum[c] = nodal(Eigen::seqN(c, nodal.size() / dimension, dimension)).sum();
  return sum;
}

/// Largest length of a node's vector.
inline double largest_length(const Vector& nodal, int dimension) {
  if (nodal.size() == 0) return 0;
  return std::sqrt(
      nodal.reshaped(dimension, nodal.size() / dimension).colwise().squaredNorm().maxCoeff());
}

/// Calls f with the dimension as a constant of compile time.
template <class F>
decltype(auto) with_dimension(int dimension, F&& f) {
  return dimension == 2 ? f(std::integral_constant<int, 2>{}) : f(std::integral_constant<int, 3>{});
}

}  // namespace acopla::fem
