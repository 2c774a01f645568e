// Where the forces jump there may be no motion that both sides agree on.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

namespace acopla::coupler {

/// The force of a contact with a dashpot begins with a jump, and whether it begins within a step of the particles or in the next depends on the
/// motion that is iterated for: H(x) jumps, and x = H(x) may have no solution but one in Filippov's sense, an x on either side of which
/// a convex combination of the residuals r = H(x) − x is zero. This finds two such iterates, and brings them as close as is asked.
class Jump {
 public:
  using Vector = Eigen::VectorXd;

  void begin_window();
  /// An iterate and its residual. @param tolerance  of |r|: a combination below is zero
  void note(const Vector& x, const Vector& residual, double tolerance);
  /// Two iterates enclose a solution, and the residual stopped falling: the next() ones are taken from between them.
  bool enclosed() const { return ends_.has_value(); }
  /// A point between them: where the residual would be zero if it were linear, and once it was found not to be, the middle.
  Vector next() const;
  /// The residual jumps between iterates that are no farther apart than this.
  bool closer_than(double distance) const { return ends_ && jumps_ && (ends_->first.x - ends_->second.x).norm() <= distance; }
  /// Of the two the one with the smaller residual.
  const Vector& better() const { return smaller().x; }

 private:
  struct Iterate {
    Vector x, residual;
  };
  const Iterate& smaller() const { return ends_->first.residual.norm() <= ends_->second.residual.norm() ? ends_->first : ends_->second; }
  /// θ in (0, 1) where |θ a + (1 − θ) b| is least and below the tolerance or a tenth of both; else nothing.
  static std::optional<double> crossing(const Vector& a, const Vector& b, double tolerance);

  std::vector<Iterate> past_;
  std::optional<std::pair<Iterate, Iterate>> ends_;
  bool jumps_ = false;
};

}  // namespace acopla::coupler
