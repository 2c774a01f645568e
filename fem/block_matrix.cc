#include "fem/block_matrix.h"

#include <algorithm>
#include <cmath>

namespace acopla::fem {
namespace {

/// Rows of one node times x. @param blocks  of the row, each row by row
template <int d>
void multiply_row(std::span<const std::uint32_t> columns, const double* blocks, const double* x,
                  double* result) {
  double sum[d] = {};
  for (const auto column : columns) {
    const double* v = x + d * std::size_t{column};
    for (int i = 0; i < d; ++i)
      for (int j = 0; j < d; ++j) sum[i] += blocks[d * i + j] * v[j];
    blocks += d * d;
  }
  for (int i = 0; i < d; ++i) result[i] = sum[i];
}

}  // namespace

BlockMatrix::BlockMatrix(std::shared_ptr<const CoupledNodes> pattern, int dimension)
    : pattern_(std::move(pattern)),
      dimension_(dimension),
      values_(size() * pattern_->pairs(), 0.0) {}

void BlockMatrix::add(std::span<const std::uint32_t> cell, const Eigen::MatrixXd& matrix) {
  const int d = dimension_;
  for (std::size_t a = 0; a < cell.size(); ++a)
    for (std::size_t b = 0; pattern_->has(cell[a]) && b < cell.size(); ++b) {
      double* block = values_.data() + size() * pattern_->pair(cell[a], cell[b]);
      for (int i = 0; i < d; ++i)
        for (int j = 0; j < d; ++j)
          block[d * i + j] += matrix(d * static_cast<int>(a) + i, d * static_cast<int>(b) + j);
    }
}

void BlockMatrix::multiply(const Vector& x, Vector& result) const {
  result.resize(x.size());
  with_dimension(dimension_, [&](auto d) {
    for (std::size_t n = 0; n < nodes(); ++n)
      multiply_row<d>(row(n), block(n, 0), x.data(), result.data() + d * n);
  });
}

void BlockMatrix::multiply(const Vector& x, std::span<const std::uint32_t> nodes,
                           Vector& result) const {
  with_dimension(dimension_, [&](auto d) {
    for (const auto n : nodes)
      multiply_row<d>(row(n), block(n, 0), x.data(), result.data() + d * std::size_t{n});
  });
}

double BlockMatrix::norm() const {
  double largest = 0;
  const auto d = static_cast<std::size_t>(dimension_);
  for (std::size_t n = 0; n < nodes(); ++n)
    for (std::size_t i = 0; i < d; ++i) {
      double sum = 0;
      for (std::size_t k = 0; k < row(n).size(); ++k)
        for (std::size_t j = 0; j < d; ++j) sum += std::abs(block(n, k)[d * i + j]);
      largest = std::max(largest, sum);
    }
  return largest;
}

BlockMatrix combine(double a, const BlockMatrix& stiffness, double b, const MassMatrix& mass) {
  BlockMatrix result = stiffness;
  const auto d = static_cast<std::size_t>(result.dimension_), size = d * d;
  for (auto& value : result.values_) value *= a;
  for (std::size_t pair = 0; pair < mass.values().size(); ++pair)
    for (std::size_t i = 0; i < d; ++i)
      result.values_[size * pair + (d + 1) * i] += b * mass.values()[pair];
  return result;
}

}  // namespace acopla::fem
