#include "fem/block_matrix.h"

#include <algorithm>
#include <cmath>

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

BlockMatrix::BlockMatrix(std::size_t nodes, std::span<const std::uint32_t> cell_nodes,
                         std::size_t nodes_a_cell)
    : starts_(nodes + 1, 0) {
  const auto owners = invert(nodes, cell_nodes, nodes_a_cell);
  std::vector<std::uint32_t> neighbours;
  for (std::size_t n = 0; n < nodes; ++n) {
    neighbours.clear();
    for (auto i = owners.starts[n]; i < owners.starts[n + 1]; ++i) {
      const auto cell = cell_nodes.subspan(owners.cells[i] * nodes_a_cell, nodes_a_cell);
      neighbours.insert(neighbours.end(), cell.begin(), cell.end());
    }
    std::sort(neighbours.begin(), neighbours.end());
    const auto last = std::unique(neighbours.begin(), neighbours.end());
    columns_.insert(columns_.end(), neighbours.begin(), last);
    starts_[n + 1] = columns_.size();
  }
  columns_.shrink_to_fit();
  values_.assign(9 * columns_.size(), 0.0);
}

void BlockMatrix::add(std::span<const std::uint32_t> cell, const Eigen::MatrixXd& matrix) {
  for (std::size_t a = 0; a < cell.size(); ++a) {
    const auto columns = row(cell[a]);
    double* values = values_.data() + 9 * starts_[cell[a]];
    for (std::size_t b = 0; b < cell.size(); ++b) {
      const auto found = std::lower_bound(columns.begin(), columns.end(), cell[b]);
      double* block = values + 9 * (found - columns.begin());
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
          block[3 * i + j] += matrix(3 * static_cast<int>(a) + i, 3 * static_cast<int>(b) + j);
    }
  }
}

void BlockMatrix::multiply(const Vector& x, Vector& result) const {
  result.resize(x.size());
  const double* from = x.data();
  for (std::size_t n = 0; n < nodes(); ++n) {
    double sum[3] = {0, 0, 0};
    const double* block = values_.data() + 9 * starts_[n];
    for (auto i = starts_[n]; i < starts_[n + 1]; ++i, block += 9) {
      const double* v = from + 3 * std::size_t{columns_[i]};
      for (int d = 0; d < 3; ++d)
        sum[d] += block[3 * d] * v[0] + block[3 * d + 1] * v[1] + block[3 * d + 2] * v[2];
    }
    for (int d = 0; d < 3; ++d) result[static_cast<Eigen::Index>(3 * n) + d] = sum[d];
  }
}

double BlockMatrix::norm() const {
  double largest = 0;
  for (std::size_t n = 0; n < nodes(); ++n)
    for (int d = 0; d < 3; ++d) {
      double sum = 0;
      for (auto i = starts_[n]; i < starts_[n + 1]; ++i)
        for (int j = 0; j < 3; ++j)
          sum += std::abs(values_[9 * i + static_cast<std::size_t>(3 * d + j)]);
      largest = std::max(largest, sum);
    }
  return largest;
}

}  // namespace acopla::fem
