// Which nodes of a mesh share a cell: the pattern of every matrix of the structure.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace acopla::fem {

class CoupledNodes {
 public:
  /// @param cell_nodes  `nodes_a_cell` node numbers a cell, cell after cell, each below `nodes`
  CoupledNodes(std::size_t nodes, std::span<const std::uint32_t> cell_nodes,
               std::size_t nodes_a_cell);
  /// The rows of the nodes marked alone: those of others are empty, and matrices of this pattern keep and add nothing there.
  /// @param rows  one mark a node
  CoupledNodes(std::size_t nodes, std::span<const std::uint32_t> cell_nodes, std::size_t nodes_a_cell, const std::vector<char>& rows);

  std::size_t nodes() const { return starts_.size() - 1; }
  std::size_t pairs() const { return columns_.size(); }  ///< ordered, a node with itself too
  /// Nodes coupled to `node`, ascending.
  std::span<const std::uint32_t> row(std::size_t node) const {
    return {columns_.data() + starts_[node], columns_.data() + starts_[node + 1]};
  }
  bool has(std::size_t node) const { return starts_[node] != starts_[node + 1]; }  ///< a row of this node
  /// Whether a matrix of this pattern has a row of one of these nodes.
  bool touches(std::span<const std::uint32_t> cell) const {
    for (const auto node : cell)
      if (has(node)) return true;
    return false;
  }
  /// Where the pairs of row(node) begin.
  std::size_t start(std::size_t node) const { return starts_[node]; }
  /// The pair (row, column), which must share a cell.
  std::size_t pair(std::size_t row, std::uint32_t column) const;

 private:
  std::vector<std::size_t> starts_;
  std::vector<std::uint32_t> columns_;
};

}  // namespace acopla::fem
