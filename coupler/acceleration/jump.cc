#include "coupler/acceleration/jump.h"

#include <algorithm>

namespace acopla::coupler {
namespace {

// Iterations that are remembered: the two sides of a jump are met soon after one another.
constexpr std::size_t memory = 6;
// A residual that falls by less than this has stopped falling.
constexpr double falls = 0.5;

}  // namespace

void Jump::begin_window() {
  past_.clear();
  ends_.reset();
  jumps_ = false;
}

std::optional<double> Jump::crossing(const Vector& a, const Vector& b, double tolerance) {
  const Vector change = a - b;
  const double square = change.squaredNorm();
  if (!(square > 0)) return std::nullopt;
  const double theta = -b.dot(change) / square;
  if (theta <= 0 || theta >= 1) return std::nullopt;
  const double left = (b + theta * change).norm();
  if (left > std::max(tolerance, 0.1 * std::min(a.norm(), b.norm()))) return std::nullopt;
  return theta;
}

void Jump::note(const Vector& x, const Vector& residual, double tolerance) {
  const Iterate now{x, residual};
  const double size = residual.norm();
  if (ends_) {
    // It takes the place of the one on whose side it is.
    jumps_ = size > falls * smaller().residual.norm();
    (residual.dot(ends_->first.residual) > residual.dot(ends_->second.residual) ? ends_->first : ends_->second) = now;
    return;
  }
  const auto least = std::min_element(past_.begin(), past_.end(), [](const auto& a, const auto& b) { return a.residual.norm() < b.residual.norm(); });
  if (least != past_.end() && size > falls * least->residual.norm()) {
    double distance = 0;
    for (const auto& other : past_) {
      const double apart = (x - other.x).norm();
      if (!crossing(residual, other.residual, tolerance) || (ends_ && apart >= distance)) continue;
      ends_.emplace(other, now);
      distance = apart;
    }
  }
  past_.push_back(now);
  if (past_.size() > memory) past_.erase(past_.begin());
}

Jump::Vector Jump::next() const {
  const auto& [a, b] = *ends_;
  const auto theta = jumps_ ? 0.5 : crossing(a.residual, b.residual, 0).value_or(0.5);
  return theta * a.x + (1 - theta) * b.x;
}

}  // namespace acopla::coupler
