#include "dem/neighbours.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <utility>

#ifdef __AVX2__
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

// ⌈log2 x⌉ of a positive number.
int rounded_up_log2(double x) { return static_cast<int>((std::bit_cast<std::uint64_t>(x) - 1) >> 52) - 1022; }

}  // namespace

// The cells of the levels double; where the sequence begins is free. It begins where the particles, each weighted with the volume
// of its cell over the cube of its reach, cost the least.
void HierarchicalGrid::choose_levels(std::span<const Record> positions, double smallest, double largest) {
  const double least = 2 * smallest + skin_, most = 2 * largest + skin_;
  edge_ = most;
  level_count_ = 1;
  if (most <= 2 * least || least <= 0 || most / least > 0x1p200) return;
  // Sixteen bins an octave: the upper bits of a double.
  constexpr int dropped = 52 - 4, begins = 16;
  constexpr auto one = std::bit_cast<std::uint64_t>(1.0) >> dropped;
  const auto bin_of = [&](double reach) { return (std::bit_cast<std::uint64_t>(std::max(1.0, reach / least)) >> dropped) - one; };
  std::vector<std::size_t> histogram(bin_of(most) + 1, 0);
  for (const auto& p : positions) ++histogram[bin_of(2 * p.w + skin_)];
  double cheapest = std::numeric_limits<double>::infinity();
  for (int k = 0; k < begins; ++k) {
    const double edge = least * (1 + k / static_cast<double>(begins)) * (1 + 1e-12);
    double cost = 0;
    for (std::size_t b = 0; b < histogram.size(); ++b) {
      if (!histogram[b]) continue;
      const double reach = least * std::bit_cast<double>((one + b) << dropped);
      const double cell = std::ldexp(edge, std::max(0, rounded_up_log2(reach / edge)));
      cost += static_cast<double>(histogram[b]) * std::pow(cell / reach, 3);
    }
    if (cost >= cheapest) continue;
    cheapest = cost;
    edge_ = edge;
  }
  level_count_ = 1 + static_cast<std::size_t>(std::max(0, rounded_up_log2(most / edge_)));
}

std::uint8_t HierarchicalGrid::level_of(double radius) const {
  return static_cast<std::uint8_t>(std::clamp(rounded_up_log2((2 * radius + skin_) / edge_), 0, static_cast<int>(level_count_) - 1));
}

// A level is worth its cells where it thins them out: the finest levels are merged into one that costs the least, which is
// measured as the particles in a particle's cell there, and a fixed price for every level that remains to be searched.
void HierarchicalGrid::merge_sparse_levels(std::span<const Record> positions) {
  constexpr double price_of_level = 15, price_of_empty_level = 1;  // of a cell's particle; measured
  std::vector<std::size_t> members(level_count_, 0);
  for (const auto& p : positions) ++members[level_of(p.w)];
  // Cells are counted in a small table, where they may fall on each other.
  const auto bits = std::bit_width(2 * positions.size());
  std::vector<std::uint8_t> population;
  std::vector<std::size_t> entry;
  double cheapest = std::numeric_limits<double>::infinity();
  std::size_t merged = 0;
  for (std::size_t l = 0; l < level_count_; ++l) {
    population.assign(std::size_t{1} << bits, 0);
    entry.clear();
    for (const auto& p : positions) {
      if (level_of(p.w) > l) continue;
      const auto at = coarser(cell_of(p), l);
      const std::uint64_t mixed = (at[0] * 0x9e3779b97f4a7c15u) ^ (at[1] * 0xc2b2ae3d27d4eb4fu) ^ (at[2] * 0x165667b19e3779f9u);
      entry.push_back((mixed * 0x9e3779b97f4a7c15u) >> (64 - bits));
      auto& n = population[entry.back()];
      n = static_cast<std::uint8_t>(n + (n < 255));
    }
    double cost = 0;
    for (const auto e : entry) cost += population[e];
    cost /= static_cast<double>(positions.size());
    if (cost > cheapest) break;  // and coarser ones are worse
    for (std::size_t k = l + 1; k < level_count_; ++k) cost += members[k] ? price_of_level : price_of_empty_level;
    if (cost >= cheapest) continue;
    cheapest = cost;
    merged = l;
  }
  edge_ = std::ldexp(edge_, static_cast<int>(merged));
  level_count_ -= merged;
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
  if (level_count_ > 1) merge_sparse_levels(positions);
  counts_ = cell_of(high);
  for (auto& n : counts_) ++n;
  rows_around_ = counts_[2] == 1 ? 3 : 9;

  home_.resize(count);
  slot_of_.resize(count);
  index_.resize(count + lanes);
  for (auto* values : {&x_, &y_, &z_, &w_}) values->resize(count + lanes);
  table_.clear();
  if (level_count_ == 1 && fits_table(count)) {
    fill_table(positions);
    return;
  }
  if (levels_.size() < level_count_) levels_.resize(level_count_);
  level_of_.resize(count);
  for (std::size_t i = 0; i < count; ++i) level_of_[i] = level_of(positions[i].w);
  for (std::size_t l = 0; l < level_count_; ++l) make_level(l, positions);
  link_levels();
}

HierarchicalGrid::Coordinates HierarchicalGrid::cell_of(const Record& p) const {
  const double inverse = 1 / edge_;
  return {static_cast<std::uint32_t>((p.x - low_[0]) * inverse), static_cast<std::uint32_t>((p.y - low_[1]) * inverse),
          static_cast<std::uint32_t>((p.z - low_[2]) * inverse)};
}

// Cells are numbered row by row and layer by layer. One empty cell at the end of every row and one empty row at the end of every
// layer keep the neighbours of a cell at the border from being those of the next row.
HierarchicalGrid::Numbering HierarchicalGrid::numbering(std::size_t l) const {
  const std::uint64_t row = ((counts_[0] - 1) >> l) + 2, layer = row * (((counts_[1] - 1) >> l) + 2);
  return {row, layer, (deep() ? layer : 0) + row + 1};
}

// A table of all cells is the fastest, where it is not much larger than the particles themselves.
bool HierarchicalGrid::fits_table(std::size_t count) const {
  const auto number = numbering(0);
  const double layers = deep() ? counts_[2] + 2.0 : 1.0;
  return static_cast<double>(number.layer) * layers <= std::min(8.0 * static_cast<double>(count) + 512, 0x1p31);
}

void HierarchicalGrid::fill_table(std::span<const Record> positions) {
  const auto number = numbering(0);
  // Counted two entries late and then moved on by placing, it ends as the first slot of each cell.
  table_.assign(number.layer * (deep() ? counts_[2] + 2 : 1) + 2 * number.row + 4, 0);
  for (std::size_t i = 0; i < positions.size(); ++i) {
    home_[i] = static_cast<std::uint32_t>(number(cell_of(positions[i])));
    ++table_[home_[i] + 2];
  }
  std::uint32_t sum = 0;
  for (auto& n : table_) n = sum += n;
  for (std::uint32_t i = 0; i < positions.size(); ++i) place(i, positions[i], table_[home_[i] + 1]++);
  std::size_t k = 0;
  for (int z = deep() ? -1 : 0; z <= (deep() ? 1 : 0); ++z)
    for (int y = -1; y <= 1; ++y) offsets_[k++] = static_cast<std::uint32_t>(number.offset(y, z));
}

void HierarchicalGrid::place(std::uint32_t i, const Record& particle, std::uint32_t slot) {
  x_[slot] = particle.x;
  y_[slot] = particle.y;
  z_[slot] = particle.z;
  w_[slot] = particle.w;
  index_[slot] = i;
  slot_of_[i] = slot;
}

void HierarchicalGrid::make_level(std::size_t l, std::span<const Record> positions) {
  auto& level = levels_[l];
  const auto number = numbering(l);
  entries_.clear();
  for (std::uint32_t i = 0; i < positions.size(); ++i)
    if (level_of_[i] == l) entries_.push_back({number(coarser(cell_of(positions[i]), l)), i, false});
  auto* const finer = l > 0 ? &levels_[l - 1] : nullptr;
  if (finer) {
    finer->parent.resize(finer->cells());
    for (std::uint32_t c = 0; c < finer->cells(); ++c) entries_.push_back({number(coarser(finer->at[c], 1)), c, true});
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
      level.at.push_back(entry.is_cell ? coarser(finer->at[entry.item], 1) : coarser(cell_of(positions[entry.item]), l));
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
    home_[i] = cell;
    place(i, p, slot++);
    level.highest.back() = std::max(level.highest.back(), i + 1);
    level.largest = std::max(level.largest, p.w);
  }
  level.first.push_back(slot);
  for (int k = 0; k < 3; ++k) level.key.push_back(std::numeric_limits<std::uint64_t>::max());
  level.at.push_back({});
  level.size = std::ldexp(1.0, static_cast<int>(l));
  level.largest_to_here = finer ? std::max(finer->largest_to_here, level.largest) : level.largest;
  link_rows(level, number);
}

namespace {

// For cells in ascending order and as many ascending numbers, `number(c)`: the range of `keys`, ascending too, from number(c) to
// number(c) + width − 1, width ≤ 3. One sweep.
void link(std::size_t cells, const auto& number, std::uint64_t width, const std::vector<std::uint64_t>& keys, const auto& set) {
  const std::uint64_t* const key = keys.data();
  std::uint32_t begin = 0;
  for (std::size_t c = 0; c < cells; ++c) {
    const auto first = number(c), past = first + width;
    while (key[begin] < first) ++begin;
    set(c, begin, begin + (key[begin] < past) + (key[begin + 1] < past) + (key[begin + 2] < past));
  }
}

}  // namespace

void HierarchicalGrid::link_rows(Level& level, const Numbering& number) const {
  level.around.resize(level.cells() * rows_around_);
  std::size_t k = 0;
  for (int z = deep() ? -1 : 0; z <= (deep() ? 1 : 0); ++z)
    for (int y = -1; y <= 1; ++y, ++k) {
      const auto before = number.offset(y, z) - 1;
      link(level.cells(), [&](std::size_t c) { return level.key[c] + before; }, 3, level.key,
           [&](std::size_t c, std::uint32_t begin, std::uint32_t end) { level.around[c * rows_around_ + k] = {begin, end}; });
    }
}

void HierarchicalGrid::link_levels() {
  levels_[0].highest_finer.assign(levels_[0].cells(), 0);
  for (std::size_t l = 1; l < level_count_; ++l) {
    auto &level = levels_[l], &finer = levels_[l - 1];
    level.highest_finer.assign(level.cells(), 0);
    for (std::size_t c = 0; c < finer.cells(); ++c) {
      auto& highest = level.highest_finer[finer.parent[c]];
      highest = std::max({highest, finer.highest[c], finer.highest_finer[c]});
    }
    level.children.resize(level.cells());
    const auto number = numbering(l - 1);
    for (std::uint32_t k = 0; k < (deep() ? 4 : 2); ++k)
      link(level.cells(),
           [&](std::size_t c) {
             const auto& at = level.at[c];
             return number({2 * at[0], 2 * at[1] + (k & 1), 2 * at[2] + (k >> 1)});
           },
           2, finer.key, [&](std::size_t c, std::uint32_t begin, std::uint32_t end) { level.children[c][k] = {begin, end}; });
  }
  for (std::size_t l = level_count_; l-- > 0;) {
    auto& level = levels_[l];
    level.coarser_cell.assign(level.cells(), 0);
    level.coarser_level.assign(level.cells(), none);
    if (l + 1 == level_count_) continue;
    const auto& coarser = levels_[l + 1];
    for (std::size_t c = 0; c < level.cells(); ++c) {
      const auto parent = level.parent[c];
      const auto* const around = coarser.around.data() + parent * rows_around_;
      const bool populated =
          std::any_of(around, around + rows_around_, [&](const CellRange& r) { return coarser.first[r.begin] != coarser.first[r.end]; });
      level.coarser_cell[c] = populated ? parent : coarser.coarser_cell[parent];
      level.coarser_level[c] = populated ? static_cast<std::uint8_t>(l + 1) : coarser.coarser_level[parent];
    }
  }
}

std::size_t HierarchicalGrid::cells() const {
  std::size_t sum = table_.size();
  for (std::size_t l = 0; l < level_count_ && table_.empty(); ++l) sum += levels_[l].cells();
  return sum;
}

// --- searching

namespace {

using Indices = std::uint32_t __attribute__((vector_size(4 * lanes)));

// Sorts eight numbers: Batcher's odd-even merge sort as six rounds of comparing each lane with another.
void sort_lanes(Indices& v) {
  const auto compare = [&v](const Indices& partner, const Indices& keeps_larger) {
    const Indices other = __builtin_shuffle(v, partner);
    v = static_cast<Indices>(v > other) == -keeps_larger ? v : other;
  };
  compare(Indices{1, 0, 3, 2, 5, 4, 7, 6}, Indices{0, 1, 0, 1, 0, 1, 0, 1});
  compare(Indices{2, 3, 0, 1, 6, 7, 4, 5}, Indices{0, 0, 1, 1, 0, 0, 1, 1});
  compare(Indices{0, 2, 1, 3, 4, 6, 5, 7}, Indices{0, 0, 1, 0, 0, 0, 1, 0});
  compare(Indices{4, 5, 6, 7, 0, 1, 2, 3}, Indices{0, 0, 0, 0, 1, 1, 1, 1});
  compare(Indices{0, 1, 4, 5, 2, 3, 6, 7}, Indices{0, 0, 0, 0, 1, 1, 0, 0});
  compare(Indices{0, 2, 1, 4, 3, 6, 5, 7}, Indices{0, 0, 1, 0, 1, 0, 1, 0});
}

// Sorts a row that may be followed by `lanes` numbers that do not matter. Most rows are short: those without a branch.
void sort_row(std::uint32_t* begin, std::uint32_t* end) {
  const auto count = static_cast<std::uint32_t>(end - begin);
  if (count > lanes) {
    std::sort(begin, end);
    return;
  }
  constexpr Indices place{0, 1, 2, 3, 4, 5, 6, 7};
  Indices row;
  std::memcpy(&row, begin, sizeof row);
  row = place < count ? row : ~Indices{};
  sort_lanes(row);
  std::memcpy(begin, &row, sizeof row);
}

#ifdef __AVX2__
// Lanes in which a mask of eight bits is set, first to last.
constexpr auto set_lanes = [] {
  std::array<std::array<std::uint8_t, lanes>, 256> table{};
  for (std::size_t mask = 0; mask < table.size(); ++mask)
    for (std::size_t lane = 0, n = 0; lane < lanes; ++lane)
      if (mask >> lane & 1) table[mask][n++] = static_cast<std::uint8_t>(lane);
  return table;
}();
#endif

}  // namespace

// One particle's search for partners.
struct HierarchicalGrid::Search {
  const double *x, *y, *z, *w;
  const std::uint32_t* index;

  std::uint32_t i;             // the particle
  double px, py, pz, reach;    // reach: its radius and the skin

  // Appends the partners among slots [begin, end) at `out`, where there is room for all of them and `lanes` more.
  [[gnu::always_inline]] inline std::uint32_t* test(std::uint32_t begin, std::uint32_t end, std::uint32_t* out) const {
#ifdef __AVX2__
    const auto px4 = _mm256_set1_pd(px), py4 = _mm256_set1_pd(py), pz4 = _mm256_set1_pd(pz), reach4 = _mm256_set1_pd(reach);
    const auto near_four = [&](std::uint32_t s) {
      const auto dx = _mm256_sub_pd(px4, _mm256_loadu_pd(x + s)), dy = _mm256_sub_pd(py4, _mm256_loadu_pd(y + s));
      const auto dz = _mm256_sub_pd(pz4, _mm256_loadu_pd(z + s)), sum = _mm256_add_pd(reach4, _mm256_loadu_pd(w + s));
      const auto square = _mm256_add_pd(_mm256_mul_pd(dz, dz), _mm256_add_pd(_mm256_mul_pd(dy, dy), _mm256_mul_pd(dx, dx)));
      return static_cast<unsigned>(_mm256_movemask_pd(_mm256_cmp_pd(square, _mm256_mul_pd(sum, sum), _CMP_LT_OQ)));
    };
    const auto i8 = _mm256_set1_epi32(static_cast<int>(i));  // indices are below 2³¹
    for (auto s = begin; s < end; s += lanes) {
      const auto valid = end - s >= lanes ? 255u : (1u << (end - s)) - 1;
      const auto partner = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(index + s));
      const auto later = static_cast<unsigned>(_mm256_movemask_ps(_mm256_castsi256_ps(_mm256_cmpgt_epi32(partner, i8))));
      const auto near = valid & later & (near_four(s) | near_four(s + 4) << 4);
      const auto lane = _mm256_cvtepu8_epi32(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(set_lanes[near].data())));
      _mm256_storeu_si256(reinterpret_cast<__m256i*>(out), _mm256_permutevar8x32_epi32(partner, lane));
      out += std::popcount(near);
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
};

HierarchicalGrid::Search HierarchicalGrid::search_of(std::uint32_t i) const {
  const auto s = slot_of_[i];
  return {x_.data(), y_.data(), z_.data(), w_.data(), index_.data(), i, x_[s], y_[s], z_[s], w_[s] + skin_};
}

namespace {

// Where the next partners go: the end of the list so far, with room for so many.
std::uint32_t* room(PairList& rows, std::uint32_t found, std::size_t more) {
  const auto needed = found + more + lanes;
  if (rows.second.size() < needed) rows.second.resize(2 * needed);
  return rows.second.data() + found;
}

}  // namespace

void HierarchicalGrid::find_pairs(std::uint32_t first, std::uint32_t last, PairList& rows) const {
  rows.start.resize(last - first + 1);
  rows.start[0] = 0;
  rows.examined = 0;
  rows.second.resize(std::max<std::size_t>(rows.second.capacity(), lanes));
  std::uint32_t found = 0;
  const auto search_rows = [&](const auto& search) {
    for (auto i = first; i < last; ++i) {
      const auto begin = found;
      found = search(i, begin);
      sort_row(rows.second.data() + begin, rows.second.data() + found);
      rows.start[i - first + 1] = found;
    }
  };
  if (!table_.empty()) search_rows([&](std::uint32_t i, std::uint32_t begin) { return search_table(i, begin, rows); });
  else search_rows([&](std::uint32_t i, std::uint32_t begin) { return search_levels(i, begin, rows); });
  rows.second.resize(found);
}

inline std::uint32_t HierarchicalGrid::search_table(std::uint32_t i, std::uint32_t found, PairList& rows) const {
  const auto search = search_of(i);
  std::array<CellRange, 9> slots;
  std::uint32_t sum = 0;
  for (std::size_t k = 0; k < rows_around_; ++k) {
    const auto* const middle = table_.data() + (home_[i] + offsets_[k]);
    slots[k] = {middle[-1], middle[2]};
    sum += slots[k].end - slots[k].begin;
  }
  rows.examined += sum;
  auto* out = room(rows, found, sum);
  for (std::size_t k = 0; k < rows_around_; ++k) out = search.test(slots[k].begin, slots[k].end, out);
  return static_cast<std::uint32_t>(out - rows.second.data());
}

// The search through the levels.
struct HierarchicalGrid::Climb {
  const HierarchicalGrid& grid;
  const Search& search;
  PairList& rows;
  std::uint32_t found;
  const double inverse = 1 / grid.edge_;
  const std::array<double, 3> at{(search.px - grid.low_[0]) * inverse, (search.py - grid.low_[1]) * inverse,
                                 (search.pz - grid.low_[2]) * inverse};  // in finest cells

  void test(std::uint32_t begin, std::uint32_t end) {
    rows.examined += end - begin;
    auto* const out = room(rows, found, end - begin);
    found = static_cast<std::uint32_t>(search.test(begin, end, out) - rows.second.data());
  }

  // Particles of level l: in the cell that contains the centre and in those around it that are within reach. As few branches as
  // can be, since nobody could predict them.
  void across(std::size_t l, std::uint32_t cell) {
    const auto& level = grid.levels_[l];
    const double near = (search.reach + level.largest) * inverse + slack;
    const auto& centre = level.at[cell];
    // Along each axis, whether the cells before and after are within reach.
    std::array<std::array<bool, 3>, 3> within;
    for (std::size_t d = 0; d < 3; ++d) {
      const double inside = at[d] - level.size * centre[d];
      within[d] = {inside < near, true, level.size - inside < near};
    }
    std::array<CellRange, 9> slots;
    std::size_t count = 0;
    std::uint32_t sum = 0;
    const CellRange* range = level.around.data() + cell * grid.rows_around_;
    for (std::size_t z = grid.deep() ? 0 : 1; z <= (grid.deep() ? 2 : 1); ++z)
      for (std::size_t y = 0; y < 3; ++y, ++range) {
        auto [begin, end] = *range;
        begin += static_cast<std::uint32_t>(!within[0][0] & (begin < end) & (level.at[begin][0] < centre[0]));
        end -= static_cast<std::uint32_t>(!within[0][2] & (begin < end) & (level.at[std::max(end, 1u) - 1][0] > centre[0]));
        slots[count] = {level.first[begin], level.first[end]};
        const auto length = within[1][y] & within[2][z] ? slots[count].end - slots[count].begin : 0;
        count += length > 0;
        sum += length;
      }
    rows.examined += sum;
    auto* out = room(rows, found, sum);
    for (std::size_t k = 0; k < count; ++k) out = search.test(slots[k].begin, slots[k].end, out);
    found = static_cast<std::uint32_t>(out - rows.second.data());
  }

  // Particles of levels below l in the cells [begin, end) of level l, which lie in one row: the cells inside them lie in four.
  void down(std::size_t l, std::uint32_t begin, std::uint32_t end) {
    const auto& finer = grid.levels_[l - 1];
    const auto& children = grid.levels_[l].children;
    const double near = (search.reach + finer.largest_to_here) * inverse + slack;
    for (std::size_t k = 0; k < (grid.deep() ? 4 : 2); ++k) {
      auto from = children[begin][k].begin, to = children[end - 1][k].end;
      if (from == to) continue;
      ++rows.examined;
      double chord = near * near;
      for (std::size_t d = 1; d < 3; ++d) {
        const double low = finer.at[from][d] * finer.size, outside = std::max({low - at[d], at[d] - low - finer.size, 0.0});
        chord -= outside * outside;
      }
      if (chord <= 0) continue;
      const double half = std::sqrt(chord);
      from = first_cell(finer, from, to, [&](double x) { return x + finer.size <= at[0] - half; });
      to = first_cell(finer, from, to, [&](double x) { return x < at[0] + half; });
      if (from == to) continue;
      if (finer.first[from] < finer.first[to]) test(finer.first[from], finer.first[to]);
      if (l > 1) down(l - 1, from, to);
    }
  }

  // The first cell of a row whose x, in finest cells, does not fulfil a condition that cells further left fulfil.
  static std::uint32_t first_cell(const Level& level, std::uint32_t begin, std::uint32_t end, const auto& condition) {
    const auto holds = [&](const Coordinates& cell) { return condition(cell[0] * level.size); };
    const auto* const cells = level.at.data();
    if (end - begin > 8) return static_cast<std::uint32_t>(std::partition_point(cells + begin, cells + end, holds) - cells);
    while (begin < end && holds(cells[begin])) ++begin;
    return begin;
  }
};

std::uint32_t HierarchicalGrid::search_levels(std::uint32_t i, std::uint32_t found, PairList& rows) const {
  const auto search = search_of(i);
  Climb climb{*this, search, rows, found};
  std::size_t l = level_of_[i];
  auto cell = home_[i];
  climb.across(l, cell);
  if (l > 0) {
    const auto& level = levels_[l];
    const CellRange* const around = level.around.data() + cell * rows_around_;
    for (std::size_t k = 0; k < rows_around_; ++k) {
      std::uint32_t highest = 0;
      for (auto c = around[k].begin; c < around[k].end; ++c) highest = std::max(highest, level.highest_finer[c]);
      if (highest > i + 1) climb.down(l, around[k].begin, around[k].end);
    }
  }
  while (levels_[l].coarser_level[cell] != none) {
    const auto coarser = levels_[l].coarser_level[cell];
    cell = levels_[l].coarser_cell[cell];
    l = coarser;
    climb.across(l, cell);
  }
  return climb.found;
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
  while (bits < 20 && longest > 2 * low.w * static_cast<double>(1u << bits)) ++bits;
  const double cells = static_cast<double>(1u << bits), scale = longest > 1e-300 ? cells * (1 - 1e-12) / longest : 0;
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
