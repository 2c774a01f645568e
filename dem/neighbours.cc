#include "dem/neighbours.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace acopla::dem {

void CellGrid::build(const std::vector<Record>& positions, double reach) {
  const auto count = positions.size();
  std::array<double, 3> low{}, high{};
  if (count) low = high = {positions[0].x, positions[0].y, positions[0].z};
  for (const auto& p : positions) {
    const std::array<double, 3> x{p.x, p.y, p.z};
    for (std::size_t d = 0; d < 3; ++d) {
      low[d] = std::min(low[d], x[d]);
      high[d] = std::max(high[d], x[d]);
    }
  }
  // A few particles far apart must not cost memory: never more than some eight cells a particle.
  double edge = reach;
  const double allowed = std::max(512.0, 8.0 * static_cast<double>(count));
  const auto cells = [&] {
    double product = 1;
    for (std::size_t d = 0; d < 3; ++d) product *= std::floor((high[d] - low[d]) / edge) + 1;
    return product;
  };
  while (cells() > allowed) edge *= 1.25;
  for (std::size_t d = 0; d < 3; ++d) counts_[d] = static_cast<std::int64_t>((high[d] - low[d]) / edge) + 1;

  cell_of_.resize(count);
  start_.assign(static_cast<std::size_t>(counts_[0] * counts_[1] * counts_[2]) + 1, 0);
  for (std::size_t i = 0; i < count; ++i) {
    const auto& p = positions[i];
    const auto x = std::min(counts_[0] - 1, static_cast<std::int64_t>((p.x - low[0]) / edge));
    const auto y = std::min(counts_[1] - 1, static_cast<std::int64_t>((p.y - low[1]) / edge));
    const auto z = std::min(counts_[2] - 1, static_cast<std::int64_t>((p.z - low[2]) / edge));
    cell_of_[i] = static_cast<std::uint32_t>((z * counts_[1] + y) * counts_[0] + x);
    ++start_[cell_of_[i] + 1];
  }
  for (std::size_t c = 0; c + 1 < start_.size(); ++c) start_[c + 1] += start_[c];
  order_.resize(count);
  auto next = start_;
  for (std::uint32_t i = 0; i < count; ++i) order_[next[cell_of_[i]]++] = i;
}

void CellGrid::find_pairs(const std::vector<Record>& positions, double skin, PairList& pairs) const {
  const auto count = positions.size();
  pairs.start.assign(count + 1, 0);
  pairs.second.clear();
  // The own cell and half of the 26 around it, so that each pair is found once.
  std::vector<std::array<std::int64_t, 3>> half;
  for (std::int64_t z = 0; z <= 1; ++z)
    for (std::int64_t y = -1; y <= 1; ++y)
      for (std::int64_t x = -1; x <= 1; ++x)
        if (z > 0 || y > 0 || (y == 0 && x > 0)) half.push_back({x, y, z});

  for (std::uint32_t i = 0; i < count; ++i) {
    const Record a = positions[i];
    const auto cell = static_cast<std::int64_t>(cell_of_[i]);
    const auto cx = cell % counts_[0], cy = cell / counts_[0] % counts_[1], cz = cell / (counts_[0] * counts_[1]);
    const auto try_partner = [&](std::uint32_t j) {
      const Record& b = positions[j];
      const double dx = a.x - b.x, dy = a.y - b.y, dz = a.z - b.z, reach = a.w + b.w + skin;
      if (dx * dx + dy * dy + dz * dz < reach * reach) pairs.second.push_back(j);
    };
    for (auto k = start_[cell_of_[i]]; k < start_[cell_of_[i] + 1]; ++k)
      if (order_[k] > i) try_partner(order_[k]);
    for (const auto& [x, y, z] : half) {
      if (cx + x < 0 || cx + x >= counts_[0] || cy + y < 0 || cy + y >= counts_[1] || cz + z >= counts_[2]) continue;
      const auto other = static_cast<std::size_t>(((cz + z) * counts_[1] + cy + y) * counts_[0] + cx + x);
      for (auto k = start_[other]; k < start_[other + 1]; ++k) try_partner(order_[k]);
    }
    pairs.start[i + 1] = static_cast<std::uint32_t>(pairs.second.size());
  }
}

}  // namespace acopla::dem
