#include "dem/neighbours.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#ifdef __AVX512VL__
#include <immintrin.h>
#endif

namespace acopla::dem {
namespace {

constexpr std::uint32_t most_cells = 1u << 20;  // along an edge of the bounding box, so that three coordinates fit in a key
constexpr double slack = 1e-8;                  // in finest cells: beyond the rounding of a coordinate of up to 2²⁰ of them
constexpr std::size_t lanes = 8;

struct Extent {
  Record low, high;
};

Extent extent_of(std::span<const Record> positions) {
  if (positions.empty()) return {};
  Record low = positions[0], high = low, nothing;
  for (const auto& p : positions) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z), std::min(low.w, p.w)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z), std::max(high.w, p.w)};
    // 0 · x is not 0 where x is not finite.
    nothing = {nothing.x + 0 * p.x, nothing.y + 0 * p.y, nothing.z + 0 * p.z, nothing.w + 0 * p.w};
  }
  const double longest = std::max({high.x - low.x, high.y - low.y, high.z - low.z});
  if (!(nothing.x == 0 && nothing.y == 0 && nothing.z == 0 && nothing.w == 0 && longest <= std::numeric_limits<double>::max()))
    throw std::invalid_argument("neighbours: a particle's position or radius is not finite");
  if (low.w < 0) throw std::invalid_argument("neighbours: a particle's radius is negative");
  return {low, high};
}

// Stable sort by key, least significant byte first.
template <class Keyed>
void sort_by_key(std::vector<Keyed>& items, std::vector<Keyed>& scratch) {
  std::uint64_t any = 0;
  for (const auto& item : items) any |= item.key;
  if (items.size() < 64) {
    std::stable_sort(items.begin(), items.end(), [](const Keyed& a, const Keyed& b) { return a.key < b.key; });
    return;
  }
  scratch.resize(items.size());
  for (int shift = 0; shift < 64 && any >> shift; shift += 8) {
    std::array<std::uint32_t, 256> next{};
    for (const auto& item : items) ++next[(item.key >> shift) & 255];
    std::uint32_t sum = 0;
    for (auto& n : next) n = std::exchange(sum, sum + n);
    for (const auto& item : items) scratch[next[(item.key >> shift) & 255]++] = item;
    items.swap(scratch);
  }
}

}  // namespace

// --- building

void HierarchicalGrid::choose_levels(std::span<const Record> positions, double smallest, double largest) {
  const double least = 2 * smallest + skin_, most = 2 * largest + skin_;
  edge_ = most;
  level_count_ = 1;
  if (most <= 2 * least || least <= 0) return;
  // The cells of the levels double, but where the sequence begins is free: where the particles, each weighted with the volume
  // of its cells over the cube of its reach, cost the least.
  constexpr int steps = 16;  // an octave
  std::vector<std::size_t> histogram;
  for (const auto& p : positions) {
    const auto bin = static_cast<std::size_t>(std::ceil(steps * std::log2((2 * p.w + skin_) / least) - 1e-9));
    if (bin >= histogram.size()) histogram.resize(bin + 1, 0);
    ++histogram[bin];
  }
  double cheapest = std::numeric_limits<double>::infinity();
  int best = 0;
  for (int begin = 0; begin < steps; ++begin) {
    double cost = 0;
    for (std::size_t b = 0; b < histogram.size(); ++b) {
      const int above = static_cast<int>(b) - begin;
      const int gap = above <= 0 ? -above : (steps - above % steps) % steps;
      cost += static_cast<double>(histogram[b]) * std::exp2(3.0 * gap / steps);
    }
    if (cost < cheapest) {
      cheapest = cost;
      best = begin;
    }
  }
  edge_ = least * std::exp2(static_cast<double>(best) / steps) * (1 + 1e-9);
  level_count_ = 1 + static_cast<std::size_t>(std::max(0.0, std::ceil(std::log2(most / edge_))));
}

std::uint8_t HierarchicalGrid::level_of(double radius) const {
  int exponent = 0;
  const double mantissa = std::frexp((2 * radius + skin_) / edge_, &exponent);
  if (mantissa <= 0.5) --exponent;
  return static_cast<std::uint8_t>(std::clamp(exponent, 0, static_cast<int>(level_count_) - 1));
}

void HierarchicalGrid::build(std::span<const Record> positions, double skin) {
  if (!(skin >= 0 && skin <= std::numeric_limits<double>::max()))
    throw std::invalid_argument("neighbours: the skin is negative or not finite");
  if (positions.size() >= 1u << 31) throw std::invalid_argument("neighbours: more than 2^31 particles");
  const auto [low, high] = extent_of(positions);
  const auto count = positions.size();
  const double longest = std::max({high.x - low.x, high.y - low.y, high.z - low.z});
  skin_ = skin;
  low_ = {low.x, low.y, low.z};
  choose_levels(positions, low.w, high.w);
  // Very small particles in a very long box share cells; so do points without any reach.
  while (level_count_ > 1 && edge_ < longest / (most_cells - 2)) {
    edge_ *= 2;
    --level_count_;
  }
  edge_ = std::max({edge_, longest / (most_cells - 2), std::numeric_limits<double>::min()}) * (1 + slack);
  const double inverse = 1 / edge_;
  counts_ = {static_cast<std::uint32_t>((high.x - low.x) * inverse) + 1, static_cast<std::uint32_t>((high.y - low.y) * inverse) + 1,
             static_cast<std::uint32_t>((high.z - low.z) * inverse) + 1};
  rows_around_ = counts_[2] == 1 ? 3 : 9;

  if (levels_.size() < level_count_) levels_.resize(level_count_);
  at_.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto& p = positions[i];
    at_[i] = {static_cast<std::uint32_t>((p.x - low.x) * inverse), static_cast<std::uint32_t>((p.y - low.y) * inverse),
              static_cast<std::uint32_t>((p.z - low.z) * inverse)};
  }
  level_of_.clear();
  if (level_count_ > 1) {
    level_of_.resize(count);
    for (std::size_t i = 0; i < count; ++i) level_of_[i] = level_of(positions[i].w);
  }
  cell_of_.resize(count);
  slot_of_.resize(count);
  index_.resize(count + lanes);
  for (auto* values : {&x_, &y_, &z_, &w_}) values->resize(count + lanes);
  for (std::size_t l = 0; l < level_count_; ++l) make_level(l, positions);
  if (level_count_ > 1) link_levels();
}

void HierarchicalGrid::make_level(std::size_t l, std::span<const Record> positions) {
  auto& level = levels_[l];
  const Coordinates counts{((counts_[0] - 1) >> l) + 1, ((counts_[1] - 1) >> l) + 1, ((counts_[2] - 1) >> l) + 1};
  // One empty cell at the end of every row and one empty row at the end of every layer keep neighbours of the border from being
  // those of the next row.
  const std::uint64_t row = counts[0] + 1, layer = row * (counts[1] + 1);
  const auto key_of = [&](const Coordinates& at) {
    return (at[2] >> l) * layer + (at[1] >> l) * row + (at[0] >> l) + layer + row + 1;
  };
  entries_.clear();
  if (level_count_ == 1) {
    entries_.resize(positions.size());
    for (std::uint32_t i = 0; i < positions.size(); ++i) entries_[i] = {key_of(at_[i]), i, false};
  } else {
    for (std::uint32_t i = 0; i < positions.size(); ++i)
      if (level_of_[i] == l) entries_.push_back({key_of(at_[i]), i, false});
  }
  auto* const finer = l > 0 ? &levels_[l - 1] : nullptr;
  if (finer) {
    finer->parent.resize(finer->size());
    for (std::uint32_t c = 0; c < finer->size(); ++c) {
      const auto& at = finer->at[c];
      entries_.push_back({(at[2] >> 1) * layer + (at[1] >> 1) * row + (at[0] >> 1) + layer + row + 1, c, true});
    }
  }
  sort_by_key(entries_, entries_scratch_);

  auto slot = l > 0 ? levels_[l - 1].first.back() : 0;
  level.key.clear();
  level.at.clear();
  level.first.clear();
  level.highest.clear();
  level.largest = 0;
  std::uint64_t last = 0;  // no cell has this key
  for (const auto& entry : entries_) {
    if (entry.key != last) {
      last = entry.key;
      level.key.push_back(entry.key);
      const auto& at = entry.is_cell ? finer->at[entry.item] : at_[entry.item];
      const auto down = entry.is_cell ? 1 : l;
      level.at.push_back({at[0] >> down, at[1] >> down, at[2] >> down});
      level.first.push_back(slot);
      level.highest.push_back(0);
    }
    const auto cell = static_cast<std::uint32_t>(level.key.size() - 1);
    if (entry.is_cell) {
      finer->parent[entry.item] = cell;
      continue;
    }
    const auto i = entry.item;
    const auto& p = positions[i];
    x_[slot] = p.x;
    y_[slot] = p.y;
    z_[slot] = p.z;
    w_[slot] = p.w;
    index_[slot] = i;
    cell_of_[i] = cell;
    slot_of_[i] = slot++;
    level.highest.back() = std::max(level.highest.back(), i + 1);
    level.largest = std::max(level.largest, p.w);
  }
  level.first.push_back(slot);
  level.largest_to_here = finer ? std::max(finer->largest_to_here, level.largest) : level.largest;
  link_rows(level, counts);
}

// Both the cells and the cells beside them in a row at a given distance come in ascending order, so that one sweep finds all.
void HierarchicalGrid::link_rows(Level& level, const Coordinates& counts) const {
  const auto cells = level.key.size();
  const std::int64_t row = counts[0] + 1, layer = row * (counts[1] + 1);
  for (int k = 0; k < 3; ++k) level.key.push_back(std::numeric_limits<std::uint64_t>::max());
  level.around.resize(cells * rows_around_);
  const std::uint64_t* const key = level.key.data();
  std::size_t k = 0;
  for (std::int64_t z = rows_around_ == 9 ? -1 : 0; z <= (rows_around_ == 9 ? 1 : 0); ++z)
    for (std::int64_t y = -1; y <= 1; ++y, ++k) {
      const auto offset = static_cast<std::uint64_t>(z * layer + y * row);
      CellRange* to = level.around.data() + k;
      std::uint32_t begin = 0;
      for (std::size_t c = 0; c < cells; ++c, to += rows_around_) {
        const auto left = key[c] + offset - 1, right = left + 2;
        while (key[begin] < left) ++begin;
        *to = {begin, begin + (key[begin] <= right) + (key[begin + 1] <= right) + (key[begin + 2] <= right)};
      }
    }
}

void HierarchicalGrid::link_levels() {
  levels_[0].highest_finer.assign(levels_[0].size(), 0);
  for (std::size_t l = 1; l < level_count_; ++l) {
    auto &level = levels_[l], &finer = levels_[l - 1];
    level.highest_finer.assign(level.size(), 0);
    level.children.assign(level.size(), {});
    for (std::uint32_t c = 0; c < finer.size(); ++c) {
      const auto parent = finer.parent[c];
      auto& highest = level.highest_finer[parent];
      highest = std::max({highest, finer.highest[c], finer.highest_finer[c]});
      auto& children = level.children[parent][(finer.at[c][1] & 1) + 2 * (finer.at[c][2] & 1)];
      if (children.begin == children.end) children = {c, c + 1};
      else children.end = c + 1;
    }
  }
  for (std::size_t l = level_count_; l-- > 0;) {
    auto& level = levels_[l];
    level.coarser_cell.assign(level.size(), 0);
    level.coarser_level.assign(level.size(), none);
    if (l + 1 == level_count_) continue;
    const auto& coarser = levels_[l + 1];
    for (std::size_t c = 0; c < level.size(); ++c) {
      const auto parent = level.parent[c];
      bool populated = false;
      for (std::size_t k = 0; k < rows_around_; ++k) {
        const auto& range = coarser.around[parent * rows_around_ + k];
        populated = populated || coarser.first[range.begin] != coarser.first[range.end];
      }
      level.coarser_cell[c] = populated ? parent : coarser.coarser_cell[parent];
      level.coarser_level[c] = populated ? static_cast<std::uint8_t>(l + 1) : coarser.coarser_level[parent];
    }
  }
}

std::size_t HierarchicalGrid::cells() const {
  std::size_t sum = 0;
  for (std::size_t l = 0; l < level_count_; ++l) sum += levels_[l].size();
  return sum;
}

// --- searching

// The search of one particle's partners after the other's.
struct HierarchicalGrid::Search {
  const HierarchicalGrid& grid;
  PairList& rows;
  const double *const x = grid.x_.data(), *const y = grid.y_.data(), *const z = grid.z_.data(), *const w = grid.w_.data();
  const std::uint32_t* const index = grid.index_.data();
  const double inverse = 1 / grid.edge_;

  // The particle.
  std::uint32_t i = 0;
  double px = 0, py = 0, pz = 0, reach = 0;  // reach: its radius and the skin
  std::array<double, 3> at{};                // in finest cells

  std::uint32_t found = 0;
  std::uint64_t examined = 0;

  void begin(std::uint32_t particle) {
    i = particle;
    const auto s = grid.slot_of_[i];
    px = x[s];
    py = y[s];
    pz = z[s];
    reach = w[s] + grid.skin_;
  }

  // The particles in slots [begin, end).
  void scan(std::uint32_t begin, std::uint32_t end) {
    examined += end - begin;
    make_room(end - begin);
    found = test(begin, end, rows.second.data() + found) - rows.second.data();
  }

  void make_room(std::size_t more) {
    if (rows.second.size() < found + more + lanes) rows.second.resize(2 * (found + more + lanes));
  }

  // Appends the partners among slots [begin, end) at `out`, which has room for all of them and `lanes` more.
  [[gnu::always_inline]] inline std::uint32_t* test(std::uint32_t begin, std::uint32_t end, std::uint32_t* out) const {
#ifdef __AVX512VL__
    const auto px8 = _mm512_set1_pd(px), py8 = _mm512_set1_pd(py), pz8 = _mm512_set1_pd(pz), reach8 = _mm512_set1_pd(reach);
    const auto i8 = _mm256_set1_epi32(static_cast<int>(i));
    for (auto s = begin; s < end; s += lanes) {
      const auto valid = static_cast<__mmask8>((1u << std::min<std::size_t>(end - s, lanes)) - 1);
      const auto partner = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(index + s));
      const auto dx = _mm512_sub_pd(px8, _mm512_loadu_pd(x + s)), dy = _mm512_sub_pd(py8, _mm512_loadu_pd(y + s));
      const auto dz = _mm512_sub_pd(pz8, _mm512_loadu_pd(z + s)), sum = _mm512_add_pd(reach8, _mm512_loadu_pd(w + s));
      const auto square = _mm512_fmadd_pd(dz, dz, _mm512_fmadd_pd(dy, dy, _mm512_mul_pd(dx, dx)));
      const auto later = _mm256_mask_cmpgt_epu32_mask(valid, partner, i8);
      const auto near = _mm512_mask_cmp_pd_mask(later, square, _mm512_mul_pd(sum, sum), _CMP_LT_OQ);
      _mm256_storeu_si256(reinterpret_cast<__m256i*>(out), _mm256_maskz_compress_epi32(near, partner));
      out += std::popcount(static_cast<unsigned>(near));
    }
#else
    for (auto s = begin; s < end; ++s) {
      const double dx = px - x[s], dy = py - y[s], dz = pz - z[s], sum = reach + w[s];
      *out = index[s];
      out += (dx * dx + dy * dy + dz * dz < sum * sum) & (index[s] > i);
    }
#endif
    return out;
  }

  // All rows of cells around a cell of the particle's own level, when it is the only one.
  void scan_around(const Level& level, std::uint32_t cell) {
    const CellRange* const around = level.around.data() + cell * grid.rows_around_;
    std::array<CellRange, 9> slots;
    std::uint32_t sum = 0;
    for (std::size_t k = 0; k < grid.rows_around_; ++k) {
      slots[k] = {level.first[around[k].begin], level.first[around[k].end]};
      sum += slots[k].end - slots[k].begin;
    }
    examined += sum;
    make_room(sum);
    const Search self = *this;
    std::uint32_t* out = rows.second.data() + found;
    for (std::size_t k = 0; k < grid.rows_around_; ++k) out = self.test(slots[k].begin, slots[k].end, out);
    found = out - rows.second.data();
  }

  // The same for a cell of level l that contains the particle's centre, without cells out of reach.
  void scan_near(std::size_t l, std::uint32_t cell) {
    const auto& level = grid.levels_[l];
    const double shrink = std::exp2(-static_cast<double>(l));
    const double near = ((reach + level.largest) * inverse + slack) * shrink;
    const auto& centre = level.at[cell];
    const std::array<double, 3> inside{at[0] * shrink - centre[0], at[1] * shrink - centre[1], at[2] * shrink - centre[2]};
    const auto out_of_reach = [&](std::size_t d, std::int64_t step) {
      return step < 0 ? inside[d] >= near : step > 0 && 1 - inside[d] >= near;
    };
    const CellRange* range = level.around.data() + cell * grid.rows_around_;
    const int deep = grid.rows_around_ == 9;
    for (int dz = -deep; dz <= deep; ++dz)
      for (int dy = -1; dy <= 1; ++dy, ++range) {
        if (range->begin == range->end || out_of_reach(1, dy) || out_of_reach(2, dz)) continue;
        auto [begin, end] = *range;
        if (out_of_reach(0, -1) && level.at[begin][0] < centre[0]) ++begin;
        if (begin < end && out_of_reach(0, 1) && level.at[end - 1][0] > centre[0]) --end;
        std::uint32_t highest = 0;
        for (auto c = begin; c < end; ++c) highest = std::max(highest, level.highest[c]);
        if (highest > i + 1) scan(level.first[begin], level.first[end]);
      }
  }

  // Finer particles inside a cell of level l.
  void descend(std::size_t l, std::uint32_t cell) {
    const auto& finer = grid.levels_[l - 1];
    const double size = std::exp2(static_cast<double>(l - 1));
    const double near = (reach + finer.largest_to_here) * inverse + slack;
    for (const auto& children : grid.levels_[l].children[cell])
      for (auto c = children.begin; c < children.end; ++c) {
        const bool own = finer.highest[c] > i + 1, below = finer.highest_finer[c] > i + 1;
        if (!own && !below) continue;
        ++examined;
        double square = 0;
        for (std::size_t d = 0; d < 3; ++d) {
          const double from = finer.at[c][d] * size, outside = std::max({from - at[d], at[d] - from - size, 0.0});
          square += outside * outside;
        }
        if (square >= near * near) continue;
        if (own) scan(finer.first[c], finer.first[c + 1]);
        if (below) descend(l - 1, c);
      }
  }

  void scan_levels() {
    at = {(px - grid.low_[0]) * inverse, (py - grid.low_[1]) * inverse, (pz - grid.low_[2]) * inverse};
    const std::size_t l = grid.level_of_[i];
    const auto& level = grid.levels_[l];
    const auto cell = grid.cell_of_[i];
    scan_near(l, cell);
    auto at_level = l;
    auto at_cell = cell;
    while (grid.levels_[at_level].coarser_level[at_cell] != none) {
      const auto next_level = grid.levels_[at_level].coarser_level[at_cell];
      at_cell = grid.levels_[at_level].coarser_cell[at_cell];
      at_level = next_level;
      scan_near(at_level, at_cell);
    }
    if (l == 0) return;
    const CellRange* const around = level.around.data() + cell * grid.rows_around_;
    for (std::size_t k = 0; k < grid.rows_around_; ++k)
      for (auto c = around[k].begin; c < around[k].end; ++c)
        if (level.highest_finer[c] > i + 1) descend(l, c);
  }
};

namespace {

void sort_row(std::uint32_t* begin, std::uint32_t* end) {
  if (end - begin > 24) {
    std::sort(begin, end);
    return;
  }
  for (auto* k = begin + 1; k < end; ++k) {
    const auto value = *k;
    auto* hole = k;
    for (; hole != begin && hole[-1] > value; --hole) *hole = hole[-1];
    *hole = value;
  }
}

}  // namespace

void HierarchicalGrid::find_pairs(std::uint32_t first, std::uint32_t last, PairList& rows) const {
  rows.start.resize(last - first + 1);
  rows.start[0] = 0;
  rows.second.resize(rows.second.capacity());
  Search search{*this, rows};
  for (auto i = first; i < last; ++i) {
    const auto begin = search.found;
    search.begin(i);
    if (level_count_ == 1) search.scan_around(levels_[0], cell_of_[i]);
    else search.scan_levels();
    sort_row(rows.second.data() + begin, rows.second.data() + search.found);
    rows.start[i - first + 1] = search.found;
  }
  rows.second.resize(search.found);
  rows.examined = search.examined;
}

// --- ordering

namespace {

// Distance along the Hilbert curve through 2^bits cells along each of `dimensions` axes (Skilling 2004, "Programming the
// Hilbert curve": the axes are unwound level by level, then Gray-decoded and interleaved).
std::uint64_t hilbert_distance(std::array<std::uint32_t, 3> x, int dimensions, int bits) {
  const auto n = static_cast<std::size_t>(dimensions);
  const std::uint32_t top = bits > 0 ? 1u << (bits - 1) : 0;
  for (auto bit = top; bit > 1; bit >>= 1)
    for (std::size_t d = 0; d < n; ++d) {
      const auto below = bit - 1;
      if (x[d] & bit) {
        x[0] ^= below;
      } else {
        const auto swap = (x[0] ^ x[d]) & below;
        x[0] ^= swap;
        x[d] ^= swap;
      }
    }
  for (std::size_t d = 1; d < n; ++d) x[d] ^= x[d - 1];
  std::uint32_t flip = 0;
  for (auto bit = top; bit > 1; bit >>= 1)
    if (x[n - 1] & bit) flip ^= bit - 1;
  std::uint64_t distance = 0;
  for (int b = bits - 1; b >= 0; --b)
    for (std::size_t d = 0; d < n; ++d) distance = distance << 1 | (((x[d] ^ flip) >> b) & 1);
  return distance;
}

}  // namespace

void curve_order(std::span<const Record> positions, std::vector<std::uint32_t>& order) {
  const auto [low, high] = extent_of(positions);
  const double longest = std::max({high.x - low.x, high.y - low.y, high.z - low.z});
  // The longest edge of the box fills the curve's square or cube, so that its halves and quarters are the box's.
  int bits = 0;
  while (bits < 20 && longest > std::max(2 * low.w, 0.0) * static_cast<double>(1u << bits)) ++bits;
  const double cells = static_cast<double>(1u << bits), scale = longest > 0 ? cells * (1 - 1e-12) / longest : 0;
  const int dimensions = high.z > low.z ? 3 : 2;
  struct Keyed {
    std::uint64_t key;
    std::uint32_t item;
  };
  std::vector<Keyed> keyed(positions.size()), scratch;
  for (std::uint32_t i = 0; i < positions.size(); ++i) {
    const auto& p = positions[i];
    keyed[i] = {hilbert_distance({static_cast<std::uint32_t>((p.x - low.x) * scale), static_cast<std::uint32_t>((p.y - low.y) * scale),
                                  static_cast<std::uint32_t>((p.z - low.z) * scale)}, dimensions, bits), i};
  }
  sort_by_key(keyed, scratch);
  order.resize(positions.size());
  for (std::size_t k = 0; k < keyed.size(); ++k) order[k] = keyed[k].item;
}

}  // namespace acopla::dem
