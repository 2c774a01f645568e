// Consistent mass: the same number for every direction of a pair of nodes.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "fem/coupled_nodes.h"
#include "fem/nodal.h"

namespace acopla::fem {

/// M_ab = m_ab I with m_ab = ∫ ρ N_a N_b dV [kg]: a ninth of the memory of the stiffness.
class MassMatrix {
 public:
  /// A zero matrix.
  MassMatrix(std::shared_ptr<const CoupledNodes> pattern, int dimension);

  /// Adds a cell's matrix m_ab, one row a node.
  void add(std::span<const std::uint32_t> cell, const Eigen::MatrixXd& matrix);
  /// result = this · x.
  void multiply(const Vector& x, Vector& result) const;
  /// result = this · x in the rows of these nodes; other entries of `result` stay.
  void multiply(const Vector& x, std::span<const std::uint32_t> nodes, Vector& result) const;

  int dimension() const { return dimension_; }
  const std::shared_ptr<const CoupledNodes>& pattern() const { return pattern_; }
  const std::vector<double>& values() const { return values_; }  ///< m_ab a pair of the pattern
  double total() const;                                          ///< mass of the structure [kg]
  /// 1/(M⁻¹)_nn [kg]: what a sudden force on that node alone accelerates. Of the nodes that share a cell with it, the others held, which is a
  /// few percent too much.
  double sudden(std::uint32_t node) const;

 private:
  std::shared_ptr<const CoupledNodes> pattern_;
  int dimension_;
  std::vector<double> values_;
};

}  // namespace acopla::fem
