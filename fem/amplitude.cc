#include "fem/amplitude.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace acopla::fem {
namespace {

Amplitude make(const io::Table& table, const std::string& key,
               std::vector<std::pair<double, double>> points) {
  try {
    return Amplitude(std::move(points));
  } catch (const std::invalid_argument& error) {
    table.fail(key, error.what());
  }
}

std::vector<std::pair<double, double>> pairs(const io::Table& table, const std::string& key) {
  std::vector<std::pair<double, double>> points;
  for (const auto& row : table.vectors(key, 2)) points.emplace_back(row[0], row[1]);
  return points;
}

std::vector<std::pair<double, double>> read_columns(const std::string& path) {
  std::ifstream file(path);
  std::vector<std::pair<double, double>> points;
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream words(line);
    std::string first;
    if (!(words >> first) || first[0] == '#') continue;
    std::istringstream again(line);
    double time = 0, value = 0;
    std::string more;
    if (!(again >> time >> value) || again >> more)
      throw io::UserError({path, number, 1},
                          "a line of a record has two numbers: time [s] and value.");
    points.emplace_back(time, value);
  }
  return points;
}

}  // namespace

Amplitude::Amplitude(std::vector<std::pair<double, double>> points) : points_(std::move(points)) {
  if (points_.empty())
    throw std::invalid_argument("has no points. Give at least one, [[t, value], …].");
  integrals_.assign(points_.size(), 0.0);
  double_integrals_.assign(points_.size(), 0.0);
  for (std::size_t i = 1; i < points_.size(); ++i) {
    const auto &a = points_[i - 1], &b = points_[i];
    if (!(b.first > a.first))
      throw std::invalid_argument(fmt::format(
          "goes from t = {:.6g} s to t = {:.6g} s. Times must ascend; give a jump a short span.",
          a.first, b.first));
    const double span = b.first - a.first;
    integrals_[i] = integrals_[i - 1] + 0.5 * (a.second + b.second) * span;
    double_integrals_[i] = double_integrals_[i - 1] + span * (integrals_[i - 1] + span * (a.second / 3 + b.second / 6));
  }
}

namespace {

/// Index of the last point at or before `time`, or −1.
std::ptrdiff_t segment(const std::vector<std::pair<double, double>>& points, double time) {
  return std::upper_bound(
             points.begin(), points.end(), time,
             [](double t, const std::pair<double, double>& point) { return t < point.first; }) -
         points.begin() - 1;
}

}  // namespace

double Amplitude::value(double time) const {
  const auto i = segment(points_, time);
  if (i < 0) return points_.front().second;
  const auto& [t, y] = points_[static_cast<std::size_t>(i)];
  return y + rate(time) * (time - t);
}

double Amplitude::rate(double time) const {
  const auto i = segment(points_, time);
  if (i < 0 || i + 1 == std::ssize(points_)) return 0;
  const auto &a = points_[static_cast<std::size_t>(i)],
             &b = points_[static_cast<std::size_t>(i) + 1];
  return (b.second - a.second) / (b.first - a.first);
}

double Amplitude::integral(double time) const {
  const auto i = std::max<std::ptrdiff_t>(segment(points_, time), 0);
  const auto& [t, y] = points_[static_cast<std::size_t>(i)];
  return integrals_[static_cast<std::size_t>(i)] + 0.5 * (y + value(time)) * (time - t);
}

double Amplitude::double_integral(double time) const {
  const auto i = static_cast<std::size_t>(std::max<std::ptrdiff_t>(segment(points_, time), 0));
  const auto& [t, y] = points_[i];
  const double span = time - t;
  return double_integrals_[i] + span * (integrals_[i] + span * (y / 3 + value(time) / 6));
}

double Amplitude::mean(double start, double end) const {
  return end > start ? (integral(end) - integral(start)) / (end - start) : value(start);
}

double MotionHistory::displacement(double time) const {
  if (gives == Gives::displacements) return amplitude.value(time);
  if (gives == Gives::velocities) return amplitude.integral(time);
  const double begin = amplitude.points().front().first, end = amplitude.points().back().first;
  if (time <= begin) return 0;
  return amplitude.double_integral(std::min(time, end)) + std::max(0.0, time - end) * amplitude.integral(end);
}

double MotionHistory::velocity(double time) const {
  if (gives == Gives::displacements) return amplitude.rate(time);
  if (gives == Gives::velocities) return amplitude.value(time);
  const double begin = amplitude.points().front().first, end = amplitude.points().back().first;
  return amplitude.integral(std::clamp(time, begin, end));
}

double MotionHistory::acceleration(double time) const {
  if (gives == Gives::displacements) return 0;
  if (gives == Gives::velocities) return amplitude.rate(time);
  return time < amplitude.points().front().first || time > amplitude.points().back().first ? 0 : amplitude.value(time);
}

Amplitude correct_baseline(const Amplitude& accelerations) {
  auto points = accelerations.points();
  const double begin = points.front().first, end = points.back().first, span = end - begin;
  if (!(span > 0)) return accelerations;
  // ∫ c₀ + c₁ t = c₀ T + c₁ T²/2 = V and ∬ = c₀ T²/2 + c₁ T³/6 = U, with t from the first point.
  const double V = accelerations.integral(end) / span, U = accelerations.double_integral(end) / (span * span);
  const double c0 = 6 * U - 2 * V, c1 = (6 * V - 12 * U) / span;
  for (auto& [time, value] : points) value -= c0 + c1 * (time - begin);
  return Amplitude(std::move(points));
}

Amplitude read_amplitude(const io::Table& table) {
  if (table.has("ramp") && table.has("amplitude"))
    table.fail("ramp", "and amplitude are both given. Keep one of them.");
  if (table.has("ramp")) return Amplitude({{0.0, 0.0}, {table.number("ramp", io::positive), 1.0}});
  if (table.has("amplitude")) return make(table, "amplitude", pairs(table, "amplitude"));
  return {};
}

Amplitude read_record(const io::Table& table, const std::string& key) {
  if (!table.is_text(key)) return make(table, key, pairs(table, key));
  return make(table, key, read_columns(table.path(key)));
}

}  // namespace acopla::fem
