// Fixed-point iterations of a window, and how they are helped to converge.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <vector>

#include "io/archive.h"

namespace acopla::coupler {

/// One iteration asks the participants for x̃ = H(x): the interface's motion that follows from the forces that follow from the motion x.
/// An acceleration chooses the next x from what it has seen. x holds displacements [m] and, times the window's length, velocities.
class Acceleration {
 public:
  using Vector = Eigen::VectorXd;
  virtual ~Acceleration() = default;
  /// A window begins; what was learnt in the last may serve, or not.
  virtual void begin_window() {}
  /// @param x, answered  x and H(x), of the same length in all windows. @return the next x, finite where both are
  virtual Vector next(const Vector& x, const Vector& answered) = 0;
  /// What was learnt is of no use any more: the answer has jumped.
  virtual void forget() {}
  /// The window is accepted.
  virtual void end_window() {}
  /// Between two windows: what it knows.
  virtual void write(io::StateWriter&) {}
  virtual void read(io::StateReader&) {}
};

enum class AccelerationKind { constant, aitken, iqn_ils };

struct AccelerationOptions {
  AccelerationKind kind = AccelerationKind::iqn_ils;
  double relaxation = 0.5;     ///< constant: of every step; else of a step about which nothing is known yet; in (0, 1]
  double filter = 1e-6;        ///< iqn_ils: a difference that adds less than this to those newer than it is left out
  int reuse = 0;               ///< iqn_ils: windows whose differences are kept
};

std::unique_ptr<Acceleration> make_acceleration(const AccelerationOptions& options);

/// x + ω (x̃ − x)
class ConstantRelaxation final : public Acceleration {
 public:
  explicit ConstantRelaxation(double relaxation) : relaxation_(relaxation) {}
  Vector next(const Vector& x, const Vector& answered) override { return x + relaxation_ * (answered - x); }

 private:
  double relaxation_;
};

/// ω from the last two residuals (Irons & Tuck 1969; Küttler & Wall 2008, eq. 44), at most 1 in size, and at a window's beginning that
/// of the last window's end, at most the given one.
class Aitken final : public Acceleration {
 public:
  explicit Aitken(double relaxation) : first_(relaxation), relaxation_(relaxation) {}
  void begin_window() override;
  Vector next(const Vector& x, const Vector& answered) override;
  void write(io::StateWriter& writer) override { writer("relaxation", relaxation_); }
  void read(io::StateReader& reader) override { reader("relaxation", relaxation_); }

 private:
  double first_, relaxation_;
  std::optional<Vector> residual_;
};

/// Interface quasi-Newton with an inverse Jacobian from a least-squares model (Degroote, Bathe & Vierendeels 2009): with the differences V of
/// residuals and W of answers since the last iteration, x = x̃ + W α, α = argmin |V α + r|. Columns of V are orthogonalised from the newest on,
/// and those that add less than `filter` of their length are left out with their partners in W (Haelterman et al. 2016, QR2). Without a column, a relaxed step.
/// Where the residual has grown to more than twice the least of the window, what is known is of another branch of H, e.g. of other contacts: it is
/// forgotten, and a relaxed step is made from there.
class InterfaceQuasiNewton final : public Acceleration {
 public:
  explicit InterfaceQuasiNewton(const AccelerationOptions& options) : options_(options) {}
  void begin_window() override;
  Vector next(const Vector& x, const Vector& answered) override;
  void forget() override;
  void end_window() override;
  void write(io::StateWriter& writer) override { state(writer); }
  void read(io::StateReader& reader) override { state(reader); }
  std::size_t columns() const { return residuals_.size(); }

 private:
  template <class Archive>
  void state(Archive& archive) {
    archive("residuals", residuals_);
    archive("answers", answers_);
    archive("ages", ages_);
  }
  void drop(std::size_t column);

  AccelerationOptions options_;
  std::vector<Vector> residuals_, answers_;  // differences, newest first
  std::vector<int> ages_;                    // in windows
  std::optional<Vector> last_residual_, last_answer_;
  double least_ = 0;  // norm of the window's residuals so far; 0: none
};

}  // namespace acopla::coupler
