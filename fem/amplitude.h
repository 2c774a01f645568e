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
  /// Mean over [start, end], exactly.
  double mean(double start, double end) const;
  bool constant() const { return points_.size() == 1; }
  const std::vector<std::pair<double, double>>& points() const { return points_; }

 private:
  std::vector<std::pair<double, double>> points_{{0.0, 1.0}};
  std::vector<double> integrals_{0.0};  // up to each point
};

/// Reads `ramp` [s] (0 at t = 0, 1 from then on) or `amplitude` = [[t, factor], …]; neither is 1 at
/// all times.
/// @throws io::UserError
Amplitude read_amplitude(const io::Table& table);

/// A motion over time: `amplitude` is its displacement over that of the table, or a record of
/// velocities.
struct MotionHistory {
  Amplitude amplitude;
  bool velocities =
      false;  ///< the amplitude gives velocities [m/s]; displacement is their integral

  double displacement(double time) const {
    return velocities ? amplitude.integral(time) : amplitude.value(time);
  }
  double velocity(double time) const {
    return velocities ? amplitude.value(time) : amplitude.rate(time);
  }
  double acceleration(double time) const { return velocities ? amplitude.rate(time) : 0.0; }
};

/// Reads [[t, value], …] at `key`, or a text file of two columns that it names (separated by blanks
/// or commas; lines that begin with # are comments). @throws io::UserError
Amplitude read_record(const io::Table& table, const std::string& key);

}  // namespace acopla::fem
