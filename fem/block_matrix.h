// Sparse matrices of 3×3 blocks: stiffness couples whole nodes.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

namespace acopla::fem {

/// Values at nodes, three a node: entry 3 n + c is direction c of node n.
using Vector = Eigen::VectorXd;

/// Square sparse matrix with one row of 3×3 blocks a node; both triangles are stored. Against a
/// matrix of single entries it needs 8.4 instead of 12 bytes an entry and a ninth of the searches
/// while it is filled.
class BlockMatrix {
 public:
  /// An empty matrix in which the nodes of a cell couple with one another.
  /// @param cell_nodes  `nodes_a_cell` node numbers a cell, cell after cell, each below `nodes`
  BlockMatrix(std::size_t nodes, std::span<const std::uint32_t> cell_nodes,
              std::size_t nodes_a_cell);

  /// Adds a cell's matrix, of 3 unknowns a node of `cell`.
  void add(std::span<const std::uint32_t> cell, const Eigen::MatrixXd& matrix);

  /// result = this · x.
  void multiply(const Vector& x, Vector& result) const;

  std::size_t nodes() const { return starts_.size() - 1; }
  std::size_t blocks() const { return columns_.size(); }
  /// Nodes coupled to `node`, ascending.
  std::span<const std::uint32_t> row(std::size_t node) const {
    return {columns_.data() + starts_[node], columns_.data() + starts_[node + 1]};
  }
  /// Block `entry` of row(node), row by row.
  const double* block(std::size_t node, std::size_t entry) const {
    return values_.data() + 9 * (starts_[node] + entry);
  }
  /// Largest sum of magnitudes of a row.
  double norm() const;

 private:
  std::vector<std::size_t> starts_;
  std::vector<std::uint32_t> columns_;
  std::vector<double> values_;
};

}  // namespace acopla::fem
