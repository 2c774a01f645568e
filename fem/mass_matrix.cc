#include "fem/mass_matrix.h"

#include <Eigen/Cholesky>

namespace acopla::fem {
namespace {

template <int d>
void multiply_row(std::span<const std::uint32_t> columns, const double* values, const double* x,
                  double* result) {
  double sum[d] = {};
  for (std::size_t k = 0; k < columns.size(); ++k)
    for (int i = 0; i < d; ++i)
      sum[i] += values[k] * x[d * std::size_t{columns[k]} + static_cast<std::size_t>(i)];
  for (int i = 0; i < d; ++i) result[i] = sum[i];
}

}  // namespace

MassMatrix::MassMatrix(std::shared_ptr<const CoupledNodes> pattern, int dimension)
    : pattern_(std::move(pattern)), dimension_(dimension), values_(pattern_->pairs(), 0.0) {}

void MassMatrix::add(std::span<const std::uint32_t> cell, const Eigen::MatrixXd& matrix) {
  for (std::size_t a = 0; a < cell.size(); ++a)
    for (std::size_t b = 0; pattern_->has(cell[a]) && b < cell.size(); ++b)
      values_[pattern_->pair(cell[a], cell[b])] += matrix(static_cast<int>(a), static_cast<int>(b));
}

void MassMatrix::multiply(const Vector& x, Vector& result) const {
  result.resize(x.size());
  with_dimension(dimension_, [&](auto d) {
    for (std::size_t n = 0; n < pattern_->nodes(); ++n)
      multiply_row<d>(pattern_->row(n), values_.data() + pattern_->start(n), x.data(),
                      result.data() + d * n);
  });
}

void MassMatrix::multiply(const Vector& x, std::span<const std::uint32_t> nodes,
                          Vector& result) const {
  with_dimension(dimension_, [&](auto d) {
    for (const auto n : nodes)
      multiply_row<d>(pattern_->row(n), values_.data() + pattern_->start(n), x.data(),
                      result.data() + d * std::size_t{n});
  });
}

double MassMatrix::total() const {
  double sum = 0;
  for (const double value : values_) sum += value;
  return sum;
}

double MassMatrix::sudden(std::uint32_t node) const {
  const auto near = pattern_->row(node);
  const auto size = static_cast<Eigen::Index>(near.size());
  Eigen::MatrixXd patch = Eigen::MatrixXd::Zero(size, size);
  Eigen::VectorXd unit = Eigen::VectorXd::Zero(size);
  for (Eigen::Index a = 0; a < size; ++a) {
    const auto row = pattern_->row(near[static_cast<std::size_t>(a)]);
    const double* const values = values_.data() + pattern_->start(near[static_cast<std::size_t>(a)]);
    if (near[static_cast<std::size_t>(a)] == node) unit[a] = 1;
    // Both lists ascend.
    std::size_t k = 0;
    for (Eigen::Index b = 0; b < size && k < row.size(); ++b) {
      while (k < row.size() && row[k] < near[static_cast<std::size_t>(b)]) ++k;
      if (k < row.size() && row[k] == near[static_cast<std::size_t>(b)]) patch(a, b) = values[k];
    }
  }
  return 1 / unit.dot(patch.llt().solve(unit));
}

}  // namespace acopla::fem
