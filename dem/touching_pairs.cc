#include "dem/touching_pairs.h"

#include <algorithm>
#include <bit>

namespace acopla::dem {

void SavedPairs::clear(std::size_t writers) {
  written_.resize(writers);
  for (auto& written : written_) {
    written.pairs.clear();
    written.values.clear();
  }
}

void SavedPairs::add(std::size_t writer, std::uint32_t i, std::uint32_t j, std::size_t group, const HistoryLane* first, std::size_t numbers, std::size_t lane) {
  bool empty = true;
  for (std::size_t n = 0; n < numbers; ++n) empty &= first[n].value[lane] == 0;
  if (empty) return;
  auto& [pairs, values] = written_[writer];
  pairs.push_back({i, j, static_cast<std::uint16_t>(group), static_cast<std::uint16_t>(writer), static_cast<std::uint32_t>(values.size())});
  for (std::size_t n = 0; n < numbers; ++n) values.push_back(first[n].value[lane]);
}

void SavedPairs::settle(const std::vector<std::uint32_t>& place, const KernelTable& kernels, std::size_t particles) {
  start_.assign(particles + 1, 0);
  for (auto& [pairs, values] : written_)
    for (auto& pair : pairs) {
      pair.i = place[pair.i];
      pair.j = place[pair.j];
      if (pair.i == gone || pair.j == gone) {
        pair.i = gone;
        continue;
      }
      if (pair.i > pair.j) {
        std::swap(pair.i, pair.j);
        const auto signs = kernels.kernel[pair.group]->swap_signs();
        for (std::size_t n = 0; n < signs.size(); ++n) values[pair.first + n] *= signs[n];
      }
      ++start_[pair.i + 1];
    }
  for (std::size_t k = 0; k + 1 < start_.size(); ++k) start_[k + 1] += start_[k];
  sorted_.resize(start_.back());
  auto next = start_;
  for (const auto& written : written_)
    for (const auto& pair : written.pairs)
      if (pair.i != gone) sorted_[next[pair.i]++] = pair;
}

const double* SavedPairs::find(std::uint32_t i, std::uint32_t j) const {
  for (auto k = start_[i]; k < start_[i + 1]; ++k)
    if (sorted_[k].j == j) return &written_[sorted_[k].writer].values[sorted_[k].first];
  return nullptr;
}

namespace {

std::size_t packs(const PairContacts& group) { return (group.size + lanes - 1) / lanes; }

void pad(PairContacts& group) {
  if (group.size == 0) return;
  for (auto c = group.size; c % lanes != 0; ++c) {
    group.i[c] = group.i[group.size - 1];
    group.j[c] = group.j[group.size - 1];
  }
}

}  // namespace

// Within a block of rows every row's first neighbour comes first, then every row's second: pairs that follow each other have other members, so
// that adding their forces is no chain of additions to the same place.
void TouchingPairs::list(const PairList& rows, std::uint32_t first, std::uint32_t last) {
  constexpr std::uint32_t block = 32;
  listed_.clear();
  listed_.reserve(rows.second.size());
  std::vector<Listed> others;
  for (std::uint32_t from = first; from < last; from += block) {
    const auto to = std::min(from + block, last);
    bool more = true;
    for (std::uint32_t k = 0; more; ++k) {
      more = false;
      for (auto i = from; i < to; ++i) {
        const auto slot = rows.start[i - first] + k;
        if (slot >= rows.start[i - first + 1]) continue;
        more = true;
        const auto j = rows.second[slot];
        (j < last ? listed_ : others).push_back({i, j});
      }
    }
  }
  own_count_ = static_cast<std::uint32_t>(listed_.size());
  listed_.insert(listed_.end(), others.begin(), others.end());
}

void TouchingPairs::refresh(const Particles& particles, const PairList& rows, std::uint32_t first, std::uint32_t last, double skin,
                            const KernelTable& kernels, bool one_material, const SavedPairs* saved) {
  if (saved) {
    list(rows, first, last);
    groups_.resize(2 * kernels.kernel.size());
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      groups_[g].size = 0;
      groups_[g].exports = g % 2 == 1;
    }
    free_.assign(groups_.size(), {});
    place_.assign(listed_.size(), nowhere);
    near_.assign((listed_.size() + lanes - 1) / lanes, 0);
  }
  const Record* const position = particles.position.data();
  const auto only = one_material && first < last ? 2u * kernels.group[particles.material[first] * (kernels.materials + 1)] : 0;
  const auto group_of = [&](std::uint32_t slot) {
    const auto [i, j] = listed_[slot];
    const auto own = one_material ? only : 2u * kernels.group[particles.material[i] * kernels.materials + particles.material[j]];
    return own + (slot >= own_count_);
  };
  const auto count = listed_.size();
  std::uint32_t i[lanes], j[lanes];
  for (std::size_t c = 0; c < near_.size(); ++c) {
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      const auto& pair = listed_[std::min(c * lanes + lane, count - 1)];
      i[lane] = pair.i;
      j[lane] = pair.j;
    }
    RecordPack a = gathered(position, i), b = gathered(position, j);
    const DoublePack dx = a.x - b.x, dy = a.y - b.y, dz = a.z - b.z, reach = a.w + b.w + skin;
    // As a byte: GCC 12 under the address sanitizer stores the mask as one and reads it back as four.
    auto near = static_cast<std::uint8_t>(bits(dx * dx + dy * dy + dz * dz < reach * reach));
    if ((c + 1) * lanes > count) near &= (1u << (count - c * lanes)) - 1;
    // Few pairs come or go: the others, and their histories, stay where they are.
    auto changed = near ^ near_[c];
    near_[c] = near;
    while (changed) {
      const auto lane = static_cast<unsigned>(std::countr_zero(static_cast<unsigned>(changed)));
      changed &= changed - 1;
      const auto slot = static_cast<std::uint32_t>(c * lanes + lane);
      const auto group = group_of(slot);
      if (near >> lane & 1) enter(slot, group, kernels);
      else free_[group].push_back(place_[slot]);
    }
  }
  export_count_ = 0;
  for (auto& group : groups_) {
    pad(group);
    if (!group.exports) continue;
    group.first_export = export_count_;
    export_count_ += group.size;
  }
  if (saved) restore(*saved, kernels);
  exports.force.resize(export_count_);
  if (particles.has_spins()) exports.torque.resize(export_count_);
}

// A pair that left keeps its place until another needs it: it does not touch, and nobody else is there. When it comes back it finds it again.
void TouchingPairs::enter(std::uint32_t slot, std::size_t of, const KernelTable& kernels) {
  auto& group = groups_[of];
  auto& free = free_[of];
  if (place_[slot] != nowhere) return;
  auto place = static_cast<std::uint32_t>(group.size);
  while (!free.empty()) {
    const auto left = free.back();
    free.pop_back();
    const auto owner = group.slot[left];
    if (near_[owner / lanes] >> (owner % lanes) & 1) continue;  // it came back, or another took the place
    place_[owner] = nowhere;
    place = left;
    break;
  }
  const auto* const kernel = kernels.kernel[of / 2].get();
  const auto numbers = kernel ? kernel->history_size() : 0;
  if (place == group.size) {
    ++group.size;
    if (const auto room = packs(group) * lanes; group.i.size() < room) {
      group.i.resize(std::max(room, group.i.size() * 3 / 2));
      group.j.resize(group.i.size());
      group.slot.resize(group.i.size());
    }
    group.history.resize(packs(group) * numbers);
  }
  group.i[place] = listed_[slot].i;
  group.j[place] = listed_[slot].j;
  group.slot[place] = slot;
  place_[slot] = place;
  for (std::size_t n = 0; n < numbers; ++n) group.history[place / lanes * numbers + n].value[place % lanes] = 0;
}

void TouchingPairs::restore(const SavedPairs& saved, const KernelTable& kernels) {
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    auto& group = groups_[g];
    const auto* const kernel = kernels.kernel[g / 2].get();
    const auto numbers = kernel ? kernel->history_size() : 0;
    group.history.resize(packs(group) * numbers);  // after a longer list
    if (numbers == 0) continue;
    for (std::size_t c = 0; c < group.size; ++c)
      if (const double* values = saved.find(group.i[c], group.j[c]))
        for (std::size_t n = 0; n < numbers; ++n) group.history[c / lanes * numbers + n].value[c % lanes] = values[n];
  }
}

void TouchingPairs::save(SavedPairs& saved, std::size_t writer, const KernelTable& kernels) const {
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const auto* kernel = kernels.kernel[g / 2].get();
    const auto numbers = kernel ? kernel->history_size() : 0;
    if (numbers == 0) continue;
    const auto& group = groups_[g];
    for (std::size_t c = 0; c < group.size; ++c)
      saved.add(writer, group.i[c], group.j[c], g / 2, &group.history[c / lanes * numbers], numbers, c % lanes);
  }
}

void TouchingPairs::evaluate(const KernelTable& kernels, Particles& particles, double step, ContactEnergy<double>* energy) {
  for (std::size_t g = 0; g < groups_.size(); ++g)
    if (groups_[g].size > 0 && kernels.kernel[g / 2]) kernels.kernel[g / 2]->pairs(groups_[g], particles, exports, step, energy);
}

std::size_t TouchingPairs::size() const {
  std::size_t size = 0;
  for (const auto& group : groups_) size += group.size;
  return size;
}

std::size_t TouchingPairs::bytes() const {
  std::size_t bytes = listed_.size() * (sizeof(Listed) + sizeof(std::uint32_t)) + near_.size();
  for (const auto& group : groups_) bytes += group.size * 3 * sizeof(std::uint32_t) + group.history.size() * sizeof(HistoryLane);
  return bytes;
}

}  // namespace acopla::dem
