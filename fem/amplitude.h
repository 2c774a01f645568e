// How loads and prescribed motions vary with time.
#pragma once

#include <utility>
#include <vector>

#include "io/case_table.h"

namespace acopla::fem {

/// A function of time, linear between points and constant before the first and after the last. The
/// default is 1 at all times.
class Amplitude {
 public:
  Amplitude() = default;
  /// @param points  (time [s], value), times ascending
  /// @throws std::invalid_argument when they do not ascend, or there is none; its text continues
  /// the name of the table
  explicit Amplitude(std::vector<std::pair<double, double>> points);

  double value(double time) const;
  /// Slope [1/s]; at a point that of the segment that begins there.
  double rate(double time) const;
  /// Integral from the first point [s].
  double integral(double time) const;
  /// Integral of the integral from the first point [s²].
  double double_integral(double time) const;
  /// Mean over [start, end], exactly.
  double mean(double start, double end) const;
  bool constant() const { return points_.size() == 1; }
  const std::vector<std::pair<double, double>>& points() const { return points_; }

 private:
  std::vector<std::pair<double, double>> points_{{0.0, 1.0}};
  std::vector<double> integrals_{0.0}, double_integrals_{0.0};  // up to each point
};

/// Reads `ramp` [s] (0 at t = 0, 1 from then on) or `amplitude` = [[t, factor], …]; neither is 1 at
/// all times.
/// @throws io::UserError
Amplitude read_amplitude(const io::Table& table);

/// A motion over time: `amplitude` is its displacement over that of the table, or a record of
/// velocities or accelerations.
struct MotionHistory {
  /// What the amplitude gives: displacements; velocities [m/s], whose integral they are; accelerations [m/s²] of a motion that begins at
  /// rest with the first point and goes on without any after the last.
  enum class Gives { displacements, velocities, accelerations };
  Amplitude amplitude;
  Gives gives = Gives::displacements;

  double displacement(double time) const;
  double velocity(double time) const;
  double acceleration(double time) const;
  bool operator==(const MotionHistory& other) const {
    return gives == other.gives && amplitude.points() == other.amplitude.points();
  }
};

/// A record of accelerations less the straight line c₀ + c₁ t that it must lose to end at rest where it began: ∫a = 0 and ∬a = 0, exactly
/// for the record as it is, linear between its points. What instruments and digitising add is of this kind, and drifts away as t² and t³.
Amplitude correct_baseline(const Amplitude& accelerations);

/// Reads [[t, value], …] at `key`, or a text file of two columns that it names (separated by blanks
/// or commas; lines that begin with # are comments). @throws io::UserError
Amplitude read_record(const io::Table& table, const std::string& key);

}  // namespace acopla::fem
