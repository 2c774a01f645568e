#include "geometry/bucket_grid.h"

#include <algorithm>
#include <map>
#include <stdexcept>

namespace acopla::geometry {
namespace {

constexpr double level_ratio =
    4;  // a band this wide holds nearly all faces of an ordinary mesh in one level

double edge_of(const Box& box) { return (box.high - box.low).maxCoeff(); }

Box checked_bounds(std::span<const Box> boxes) {
  Box bounds = boxes.front();
  for (const auto& box : boxes) {
    if (!box.low.allFinite() || !box.high.allFinite())
      throw std::invalid_argument(
          "a box of the bucket grid has a coordinate that is not a finite number");
    if (!(box.low.array() <= box.high.array()).all())
      throw std::invalid_argument(
          "a box of the bucket grid has its low corner above its high corner");
    bounds.low = bounds.low.cwiseMin(box.low);
    bounds.high = bounds.high.cwiseMax(box.high);
  }
  if (!(bounds.high - bounds.low).allFinite())
    throw std::invalid_argument(
        "the boxes of the bucket grid lie too far apart for their extent to be a number");
  return bounds;
}

/// One and a half times the median edge. The median, because one huge face must not make buckets
/// for thousands of small ones; the factor, so that the band (1/4, 1] of the ordinary level reaches
/// to either side of the median.
double ordinary_size(std::span<const Box> boxes, double extent) {
  std::vector<double> edges(boxes.size());
  std::transform(boxes.begin(), boxes.end(), edges.begin(), edge_of);
  const auto middle = edges.begin() + static_cast<std::ptrdiff_t>(edges.size() / 2);
  std::nth_element(edges.begin(), middle, edges.end());
  if (*middle > 0) return 1.5 * *middle;
  return extent / std::sqrt(static_cast<double>(boxes.size()));  // points, spread over some surface
}

}  // namespace

BucketGrid::BucketGrid(std::span<const Box> boxes, double size) : item_count_(boxes.size()) {
  if (!std::isfinite(size)) throw std::invalid_argument("the bucket size is not a finite number");
  if (boxes.size() > (std::size_t{1} << 28))
    throw std::invalid_argument("more than 2^28 boxes in a bucket grid");
  if (boxes.empty()) return;
  bounds_ = checked_bounds(boxes);
  const double extent = edge_of(bounds_);
  const double least = std::ldexp(extent, -20);
  size_ = std::max(size > 0 ? size : ordinary_size(boxes, extent), least);
  if (!(size_ > 0)) size_ = 1;

  std::map<int, std::vector<std::uint32_t>>
      members;  // by power of level_ratio; a handful of levels
  for (std::uint32_t item = 0; item < boxes.size(); ++item) {
    const double edge = edge_of(boxes[item]);
    double bucket = size_;
    int level = 0;
    for (; bucket < edge; bucket *= level_ratio) ++level;
    if (!(size > 0) && edge > 0)
      for (; bucket / level_ratio >= std::max(edge, least); bucket /= level_ratio) --level;
    members[level].push_back(item);
  }
  levels_.reserve(members.size());
  for (const auto& [level, items] : members) {
    auto& added = levels_.emplace_back();
    added.size = size_ * std::pow(level_ratio, level);
    added.fill(items, boxes, bounds_.low);
  }
  smallest_size_ = levels_.front().size;
}

std::size_t BucketGrid::stored() const {
  std::size_t sum = 0;
  for (const auto& level : levels_) sum += level.items.size();
  return sum;
}

std::uint32_t BucketGrid::Level::find_or_add(std::uint64_t key) {
  if (2 * (keys.size() + 1) > slots.size()) {
    slots.assign(std::max<std::size_t>(16, 2 * slots.size()), Slot{});
    for (std::uint32_t bucket = 0; bucket < keys.size(); ++bucket)
      slots[slot_of(keys[bucket])] = {keys[bucket], bucket};
  }
  auto& slot = slots[slot_of(key)];
  if (slot.key == free_key) {
    slot = {key, static_cast<std::uint32_t>(keys.size())};
    keys.push_back(key);
  }
  return slot.bucket;
}

void BucketGrid::Level::fill(std::span<const std::uint32_t> members, std::span<const Box> boxes,
                             const Vec3& origin) {
  const auto for_each_cell = [&](const Box& box, auto&& visit) {
    const Cell first = cell_at(box.low, origin, size), last = cell_at(box.high, origin, size);
    for (std::int64_t z = first[2]; z <= last[2]; ++z)
      for (std::int64_t y = first[1]; y <= last[1]; ++y)
        for (std::int64_t x = first[0]; x <= last[0]; ++x) visit(key_of({x, y, z}));
  };
  // Two passes: count, then fill, so that the buckets lie in one array.
  std::vector<std::uint32_t> entries;  // the bucket of every item in every cell it reaches into
  entries.reserve(2 * members.size());
  for (const auto item : members)
    for_each_cell(boxes[item], [&](std::uint64_t key) { entries.push_back(find_or_add(key)); });
  starts.assign(keys.size() + 1, 0);
  for (const auto bucket : entries) ++starts[bucket + 1];
  for (std::size_t bucket = 0; bucket < keys.size(); ++bucket) starts[bucket + 1] += starts[bucket];
  items.resize(entries.size());
  auto next = starts;
  auto entry = entries.begin();
  for (const auto item : members)
    for_each_cell(boxes[item], [&](std::uint64_t) { items[next[*entry++]++] = item; });
}

}  // namespace acopla::geometry
