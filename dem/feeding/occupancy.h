// Which places are taken: particles of any sizes, found by where they are.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <unordered_map>
#include <vector>

#include "dem/contact/vector.h"

namespace acopla::dem {

/// Is a particle of this radius at this place clear of everything that is not asked about otherwise (walls, other particles)?
using Vacancy = std::function<bool(const Vec3& at, double radius)>;

/// Particles in cells of about their own diameter: one grid an octave of radii, so that a few large ones do not slow the
/// search among many small ones.
class Occupancy {
 public:
  struct Entry {
    Vec3 at;
    double radius;
    std::uint32_t index;
  };

  /// @param largest_radius  of the particles to come [m]; larger ones are found too, at a higher cost
  Occupancy(int dimension, double largest_radius) : dimension_(dimension), largest_(largest_radius) {}

  void add(const Vec3& at, double radius, std::uint32_t index = 0) {
    auto& level = levels_[level_of(radius)];
    if (level.edge == 0) level.edge = 2 * std::ldexp(largest_, -level_of(radius));
    level.largest = std::max(level.largest, radius);
    level.cells[key(level.cell_of(at))].push_back({at, radius, index});
  }

  /// Visits every particle whose surface is nearer than `gap` to that of a particle here, and some that are not, until a visit
  /// returns false. Grids finer than `finest` are left out. @return false where a visit did
  template <class Visit>
  bool for_each_near(const Vec3& at, double radius, double gap, Visit&& visit, int finest = 1 << 20) const {
    for (const auto& [number, level] : levels_) {
      if (number > finest) break;
      const double reach = radius + level.largest + gap;
      Cell low = level.cell_of(at - Vec3::Constant(reach)), high = level.cell_of(at + Vec3::Constant(reach));
      if (dimension_ == 2) low[2] = high[2] = 0;
      double count = 1;
      for (int d = 0; d < dimension_; ++d) count *= static_cast<double>(high[d] - low[d] + 1);
      const auto visit_cell = [&](const std::vector<Entry>& entries) {
        for (const auto& entry : entries)
          if (!visit(entry)) return false;
        return true;
      };
      if (count > static_cast<double>(level.cells.size())) {
        for (const auto& [where, entries] : level.cells)
          if (!visit_cell(entries)) return false;
        continue;
      }
      for (auto z = low[2]; z <= high[2]; ++z)
        for (auto y = low[1]; y <= high[1]; ++y)
          for (auto x = low[0]; x <= high[0]; ++x) {
            const auto found = level.cells.find(key({x, y, z}));
            if (found != level.cells.end() && !visit_cell(found->second)) return false;
          }
    }
    return true;
  }

  bool is_free(const Vec3& at, double radius) const {
    return for_each_near(at, radius, 0, [&](const Entry& other) {
      const double reach = radius + other.radius;
      return (at - other.at).squaredNorm() >= reach * reach;
    });
  }

  /// Number of the grid that holds particles of this radius; 0 is the coarsest.
  int level_of(double radius) const { return std::max(0, static_cast<int>(std::floor(std::log2(largest_ / radius)))); }

 private:
  using Cell = std::array<std::int64_t, 3>;
  struct Level {
    double edge = 0, largest = 0;
    std::unordered_map<std::uint64_t, std::vector<Entry>> cells;
    Cell cell_of(const Vec3& at) const {
      Cell cell{};
      for (int d = 0; d < 3; ++d) cell[static_cast<std::size_t>(d)] = static_cast<std::int64_t>(std::floor(at[d] / edge));
      return cell;
    }
  };
  static std::uint64_t key(const Cell& cell) {
    // 21 bits each; beyond a million diameters cells share a key, which costs time but loses nothing.
    const auto part = [](std::int64_t v) { return static_cast<std::uint64_t>(v) & 0x1fffff; };
    return part(cell[0]) | part(cell[1]) << 21 | part(cell[2]) << 42;
  }
  int dimension_;
  double largest_;
  std::map<int, Level> levels_;
};

}  // namespace acopla::dem
