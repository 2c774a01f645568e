// Cartesian buckets over the boxes of a surface's faces, so that finding partners costs O(n)
// (Nasato 2011, §2.6.2).
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "geometry/surface_mesh.h"

namespace acopla::geometry {

struct Box {
  Vec3 low, high;  ///< [m]
};

/// Sparse grid of buckets: only the buckets that something reaches into exist, so a hollow surface
/// costs what its faces cost and not what its bounding box would. Items much larger than the rest
/// live in grids of coarser buckets (each four times the last), so that no item ever reaches into
/// more than eight buckets. Building is O(n) in time and memory.
class BucketGrid {
 public:
  /// @param boxes  one per item [m]
  /// @param size   edge of the smallest bucket [m]; 0 chooses about one item per bucket, with
  /// smaller buckets where items
  ///               are much smaller than most. Never below 2⁻²⁰ of the extent of all boxes.
  /// @throws std::invalid_argument when a coordinate or `size` is not finite, a box has low > high,
  /// or there are more
  ///         than 2²⁸ boxes.
  explicit BucketGrid(std::span<const Box> boxes, double size = 0);

  /// Calls `visit(item)` for every item whose box reaches into a bucket that the box [low, high]
  /// touches, hence for every item whose box touches it. An item may be visited more than once.
  /// Nothing is visited for a box with a NaN. Costs O(1) for a box of about a bucket, and never
  /// more than O(n).
  template <class Visit>
  void for_each_near(const Vec3& low, const Vec3& high, Visit&& visit) const;

  double size() const { return size_; }  ///< edge of an ordinary bucket [m]
  double smallest_size() const {
    return smallest_size_;
  }                                              ///< edge of the smallest bucket in use [m]
  const Box& bounds() const { return bounds_; }  ///< of all items [m]
  std::size_t item_count() const { return item_count_; }
  /// Items counted once in every bucket they reach into: at most eight times `item_count()`.
  std::size_t stored() const;

 private:
  using Cell = std::array<std::int64_t, 3>;

  /// The buckets of one size, found by open addressing.
  struct Level {
    struct Slot {
      std::uint64_t key = free_key;
      std::uint32_t bucket = 0;
    };
    static constexpr std::uint64_t free_key = ~std::uint64_t{0};

    double size = 0;
    std::vector<Slot> slots;            // a power of two, at most half full
    std::vector<std::uint64_t> keys;    // of each bucket
    std::vector<std::uint32_t> starts;  // of each bucket's items, and one more
    std::vector<std::uint32_t> items;   // ascending inside a bucket

    std::size_t slot_of(std::uint64_t key) const;
    std::uint32_t find_or_add(std::uint64_t key);
    void fill(std::span<const std::uint32_t> members, std::span<const Box> boxes,
              const Vec3& origin);
  };

  /// Twenty-one bits a direction are enough: no bucket is smaller than 2⁻²⁰ of the extent.
  static constexpr int key_bits = 21;
  static std::uint64_t key_of(const Cell& cell) {
    return (static_cast<std::uint64_t>(cell[2]) << (2 * key_bits)) |
           (static_cast<std::uint64_t>(cell[1]) << key_bits) | static_cast<std::uint64_t>(cell[0]);
  }
  static Cell cell_of(std::uint64_t key) {
    constexpr std::uint64_t mask = (std::uint64_t{1} << key_bits) - 1;
    return {static_cast<std::int64_t>(key & mask),
            static_cast<std::int64_t>((key >> key_bits) & mask),
            static_cast<std::int64_t>(key >> (2 * key_bits))};
  }
  /// Monotone in `point`, which is what makes a look-up complete; `point` must lie inside the
  /// bounds.
  static Cell cell_at(const Vec3& point, const Vec3& origin, double size) {
    Cell cell{};
    for (int d = 0; d < 3; ++d)
      cell[d] = static_cast<std::int64_t>(std::floor((point[d] - origin[d]) / size));
    return cell;
  }

  Box bounds_{Vec3::Zero(), Vec3::Zero()};
  double size_ = 1;
  double smallest_size_ = 1;
  std::size_t item_count_ = 0;
  std::vector<Level> levels_;
};

inline std::size_t BucketGrid::Level::slot_of(std::uint64_t key) const {
  // Fibonacci hashing of the mixed key; linear probing keeps to a cache line.
  const std::size_t mask = slots.size() - 1;
  std::uint64_t hash = key ^ (key >> 31);
  hash *= 0x9e3779b97f4a7c15ull;
  auto slot = static_cast<std::size_t>(hash >> 20) & mask;
  while (slots[slot].key != key && slots[slot].key != free_key) slot = (slot + 1) & mask;
  return slot;
}

template <class Visit>
void BucketGrid::for_each_near(const Vec3& low, const Vec3& high, Visit&& visit) const {
  if (item_count_ == 0) return;
  if (!((low.array() <= bounds_.high.array()).all() && (high.array() >= bounds_.low.array()).all()))
    return;
  const Vec3 from = low.cwiseMax(bounds_.low), to = high.cwiseMin(bounds_.high);
  for (const Level& level : levels_) {
    const Cell first = cell_at(from, bounds_.low, level.size),
               last = cell_at(to, bounds_.low, level.size);
    double cells = 1;
    for (int d = 0; d < 3; ++d) cells *= static_cast<double>(last[d] - first[d] + 1);
    const auto visit_bucket = [&](std::uint32_t bucket) {
      for (auto k = level.starts[bucket]; k < level.starts[bucket + 1]; ++k) visit(level.items[k]);
    };
    if (cells <= static_cast<double>(level.keys.size())) {
      for (std::int64_t z = first[2]; z <= last[2]; ++z)
        for (std::int64_t y = first[1]; y <= last[1]; ++y)
          for (std::int64_t x = first[0]; x <= last[0]; ++x) {
            const auto& slot = level.slots[level.slot_of(key_of({x, y, z}))];
            if (slot.key != Level::free_key) visit_bucket(slot.bucket);
          }
    } else {  // the box spans more cells than there are buckets: walk the buckets instead
      for (std::uint32_t bucket = 0; bucket < level.keys.size(); ++bucket) {
        const Cell cell = cell_of(level.keys[bucket]);
        bool inside = true;
        for (int d = 0; d < 3; ++d) inside = inside && cell[d] >= first[d] && cell[d] <= last[d];
        if (inside) visit_bucket(bucket);
      }
    }
  }
}

}  // namespace acopla::geometry
