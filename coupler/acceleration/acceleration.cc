#include "coupler/acceleration/acceleration.h"

#include <algorithm>
#include <cmath>

namespace acopla::coupler {

std::unique_ptr<Acceleration> make_acceleration(const AccelerationOptions& options) {
  switch (options.kind) {
    case AccelerationKind::constant: return std::make_unique<ConstantRelaxation>(options.relaxation);
    case AccelerationKind::aitken: return std::make_unique<Aitken>(options.relaxation);
    case AccelerationKind::iqn_ils: break;
  }
  return std::make_unique<InterfaceQuasiNewton>(options);
}

void Aitken::begin_window() {
  relaxation_ = std::copysign(std::min(std::abs(relaxation_), first_), relaxation_);
  residual_.reset();
}

Acceleration::Vector Aitken::next(const Vector& x, const Vector& answered) {
  const Vector residual = answered - x;
  if (residual_) {
    const Vector change = residual - *residual_;
    const double square = change.squaredNorm();
    if (square > 0) relaxation_ = std::clamp(-relaxation_ * residual_->dot(change) / square, -1.0, 1.0);
    if (relaxation_ == 0) relaxation_ = first_;  // a residual across its change would end all motion
  }
  residual_ = residual;
  return x + relaxation_ * residual;
}

void InterfaceQuasiNewton::begin_window() {
  last_residual_.reset();
  last_answer_.reset();
  least_ = 0;
}

void InterfaceQuasiNewton::forget() {
  residuals_.clear();
  answers_.clear();
  ages_.clear();
}

void InterfaceQuasiNewton::drop(std::size_t column) {
  const auto at = static_cast<std::ptrdiff_t>(column);
  residuals_.erase(residuals_.begin() + at);
  answers_.erase(answers_.begin() + at);
  ages_.erase(ages_.begin() + at);
}

Acceleration::Vector InterfaceQuasiNewton::next(const Vector& x, const Vector& answered) {
  const Vector residual = answered - x;
  const double size = residual.norm();
  const bool strayed = least_ > 0 && size > 2 * least_;
  least_ = least_ > 0 ? std::min(least_, size) : size;
  if (strayed) {
    forget();
  } else if (last_residual_) {
    residuals_.insert(residuals_.begin(), residual - *last_residual_);
    answers_.insert(answers_.begin(), answered - *last_answer_);
    ages_.insert(ages_.begin(), 0);
  }
  last_residual_ = residual;
  last_answer_ = answered;

  // Modified Gram–Schmidt, newest first: V = Q R. A column that adds nothing goes, zero columns too: fields before the first contact.
  std::vector<Vector> basis;
  Eigen::MatrixXd upper = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(residuals_.size()), static_cast<Eigen::Index>(residuals_.size()));
  for (std::size_t k = 0; k < residuals_.size();) {
    Vector column = residuals_[k];
    const double length = column.norm();
    const auto place = static_cast<Eigen::Index>(k);
    for (std::size_t b = 0; b < basis.size(); ++b) {
      const double along = basis[b].dot(column);
      upper(static_cast<Eigen::Index>(b), place) = along;
      column -= along * basis[b];
    }
    const double left = column.norm();
    if (!(left > options_.filter * length)) {
      drop(k);
      continue;
    }
    upper(place, place) = left;
    basis.push_back(column / left);
    ++k;
  }
  if (basis.empty()) return x + options_.relaxation * residual;

  const auto columns = static_cast<Eigen::Index>(basis.size());
  Vector right(columns);
  for (Eigen::Index b = 0; b < columns; ++b) right[b] = -basis[static_cast<std::size_t>(b)].dot(residual);
  const Vector weights = upper.topLeftCorner(columns, columns).triangularView<Eigen::Upper>().solve(right);
  Vector next = answered;
  for (Eigen::Index b = 0; b < columns; ++b) next += weights[b] * answers_[static_cast<std::size_t>(b)];
  return next;
}

void InterfaceQuasiNewton::end_window() {
  for (auto& age : ages_) ++age;
  while (!ages_.empty() && ages_.back() > options_.reuse) drop(ages_.size() - 1);
}

}  // namespace acopla::coupler
