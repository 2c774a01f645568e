#include "fem/coupled_nodes.h"

#include <algorithm>

namespace acopla::fem {
namespace {

/// The cells of each node: those of node n are cells[starts[n]] … cells[starts[n + 1] - 1].
struct CellsOfNodes {
  std::vector<std::size_t> starts, cells;
};

CellsOfNodes invert(std::size_t nodes, std::span<const std::uint32_t> cell_nodes,
                    std::size_t nodes_a_cell) {
  CellsOfNodes result{std::vector<std::size_t>(nodes + 1, 0),
                      std::vector<std::size_t>(cell_nodes.size())};
  for (const auto node : cell_nodes) ++result.starts[node + 1];
  for (std::size_t n = 0; n < nodes; ++n) result.starts[n + 1] += result.starts[n];
  auto next = result.starts;
  for (std::size_t i = 0; i < cell_nodes.size(); ++i)
    result.cells[next[cell_nodes[i]]++] = i / nodes_a_cell;
  return result;
}

}  // namespace

CoupledNodes::CoupledNodes(std::size_t nodes, std::span<const std::uint32_t> cell_nodes,
                           std::size_t nodes_a_cell)
    : CoupledNodes(nodes, cell_nodes, nodes_a_cell, std::vector<char>(nodes, 1)) {}

CoupledNodes::CoupledNodes(std::size_t nodes, std::span<const std::uint32_t> cell_nodes, std::size_t nodes_a_cell, const std::vector<char>& rows)
    : starts_(nodes + 1, 0) {
  const auto owners = invert(nodes, cell_nodes, nodes_a_cell);
  std::vector<std::uint32_t> neighbours;
  for (std::size_t n = 0; n < nodes; ++n) {
    neighbours.clear();
    for (auto i = owners.starts[n]; rows[n] && i < owners.starts[n + 1]; ++i) {
      const auto cell = cell_nodes.subspan(owners.cells[i] * nodes_a_cell, nodes_a_cell);
      neighbours.insert(neighbours.end(), cell.begin(), cell.end());
    }
    std::sort(neighbours.begin(), neighbours.end());
    const auto last = std::unique(neighbours.begin(), neighbours.end());
    columns_.insert(columns_.end(), neighbours.begin(), last);
    starts_[n + 1] = columns_.size();
  }
  columns_.shrink_to_fit();
}

std::size_t CoupledNodes::pair(std::size_t row_node, std::uint32_t column) const {
  const auto columns = row(row_node);
  return starts_[row_node] +
         static_cast<std::size_t>(std::lower_bound(columns.begin(), columns.end(), column) -
                                  columns.begin());
}

}  // namespace acopla::fem
