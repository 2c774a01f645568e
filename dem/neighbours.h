// Who may touch whom: cells over the particles, and from them a list of pairs that stays valid while nobody has moved by
// half its skin.
#pragma once

#include <cstdint>
#include <vector>

#include "dem/particles.h"

namespace acopla::dem {

/// Pairs of particles within the sum of their radii and the skin, each pair once, by first member (CSR).
struct PairList {
  std::vector<std::uint32_t> start;   ///< one a particle, and the end
  std::vector<std::uint32_t> second;  ///< the other member
  std::size_t size() const { return second.size(); }
};

/// Cells of the edge of the longest reach, numbered row by row; particles sorted by cell.
class CellGrid {
 public:
  /// @param reach  largest distance of two centres that must be found [m]
  void build(const std::vector<Record>& positions, double reach);
  /// Particle indices in cell order: what Particles::reorder wants.
  const std::vector<std::uint32_t>& order() const { return order_; }
  /// The pairs within r_i + r_j + skin; positions as given to build().
  void find_pairs(const std::vector<Record>& positions, double skin, PairList& pairs) const;

 private:
  std::int64_t counts_[3] = {1, 1, 1};
  std::vector<std::uint32_t> cell_of_, start_, order_;
};

}  // namespace acopla::dem
