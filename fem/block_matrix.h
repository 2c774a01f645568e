// Sparse matrices of one block a pair of nodes: stiffness couples whole nodes.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "fem/coupled_nodes.h"
#include "fem/mass_matrix.h"
#include "fem/nodal.h"
#include "io/large_memory.h"

namespace acopla::fem {

/// Square sparse matrix with one row of d×d blocks a node, d = 2 or 3; both triangles are stored.
/// Against a matrix of single entries it needs 8.4 instead of 12 bytes an entry (d = 3) and a ninth
/// of the searches while it is filled.
class BlockMatrix {
 public:
  /// A zero matrix.
  BlockMatrix(std::shared_ptr<const CoupledNodes> pattern, int dimension);

  /// Adds a cell's matrix, in the rows that the pattern has: of d unknowns a node of `cell`.
  void add(std::span<const std::uint32_t> cell, const Eigen::MatrixXd& matrix);

  /// result = this · x.
  void multiply(const Vector& x, Vector& result) const;
  /// result = this · x in the rows of these nodes; other entries of `result` stay.
  void multiply(const Vector& x, std::span<const std::uint32_t> nodes, Vector& result) const;

  int dimension() const { return dimension_; }
  std::size_t nodes() const { return pattern_->nodes(); }
  std::size_t blocks() const { return pattern_->pairs(); }
  double bytes() const {
    return static_cast<double>(values_.size()) * 8 + static_cast<double>(blocks()) * 4;
  }
  const std::shared_ptr<const CoupledNodes>& pattern() const { return pattern_; }
  /// Nodes coupled to `node`, ascending.
  std::span<const std::uint32_t> row(std::size_t node) const { return pattern_->row(node); }
  /// Block `entry` of row(node), row by row.
  const double* block(std::size_t node, std::size_t entry) const {
    return values_.data() + size() * (pattern_->start(node) + entry);
  }
  /// Largest sum of magnitudes of a row.
  double norm() const;

 private:
  friend BlockMatrix combine(double, const BlockMatrix&, double, const MassMatrix&);
  std::size_t size() const { return static_cast<std::size_t>(dimension_ * dimension_); }

  std::shared_ptr<const CoupledNodes> pattern_;
  int dimension_;
  std::vector<double, io::LargeMemory<double>> values_;
};

/// a K + b M. Both have the same pattern.
BlockMatrix combine(double a, const BlockMatrix& stiffness, double b, const MassMatrix& mass);

}  // namespace acopla::fem
