#include "fem/baseline.h"

namespace acopla::fem {

Amplitude correct_velocities(const Amplitude& velocities) {
  auto points = velocities.points();
  const auto [begin, first] = points.front();
  const auto [end, last] = points.back();
  const double span = end - begin;
  if (!(span > 0)) return velocities;
  // The chord from the first to the last point, and a bump t (T − t) that brings back what is left of the path.
  auto bump = points;
  for (auto& [time, value] : points) value -= first + (last - first) * (time - begin) / span;
  for (auto& [time, value] : bump) value = (time - begin) * (end - time);
  const double path = Amplitude(points).integral(end), of_bump = Amplitude(bump).integral(end);
  for (std::size_t i = 0; of_bump > 0 && i < points.size(); ++i) points[i].second -= path / of_bump * bump[i].second;
  return Amplitude(std::move(points));
}

}  // namespace acopla::fem
