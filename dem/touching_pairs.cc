#include "dem/touching_pairs.h"

#include <algorithm>

namespace acopla::dem {

void SavedPairs::clear() {
  pairs_.clear();
  values_.clear();
}

void SavedPairs::add(std::uint32_t i, std::uint32_t j, std::size_t group, const HistoryLane* first, std::size_t numbers, std::size_t lane) {
  bool empty = true;
  for (std::size_t n = 0; n < numbers; ++n) empty &= first[n].value[lane] == 0;
  if (empty) return;
  pairs_.push_back({i, j, static_cast<std::uint32_t>(group), static_cast<std::uint32_t>(values_.size())});
  for (std::size_t n = 0; n < numbers; ++n) values_.push_back(first[n].value[lane]);
}

void SavedPairs::settle(const std::vector<std::uint32_t>& place, const KernelTable& kernels, std::size_t particles) {
  start_.assign(particles + 1, 0);
  for (auto& pair : pairs_) {
    pair.i = place[pair.i];
    pair.j = place[pair.j];
    if (pair.i == gone || pair.j == gone) {
      pair.i = gone;
      continue;
    }
    if (pair.i > pair.j) {
      std::swap(pair.i, pair.j);
      const auto signs = kernels.kernel[pair.group]->swap_signs();
      for (std::size_t n = 0; n < signs.size(); ++n) values_[pair.first + n] *= signs[n];
    }
    ++start_[pair.i + 1];
  }
  for (std::size_t k = 0; k + 1 < start_.size(); ++k) start_[k + 1] += start_[k];
  sorted_.resize(start_.back());
  auto next = start_;
  for (const auto& pair : pairs_)
    if (pair.i != gone) sorted_[next[pair.i]++] = pair;
}

const double* SavedPairs::find(std::uint32_t i, std::uint32_t j) const {
  for (auto k = start_[i]; k < start_[i + 1]; ++k)
    if (sorted_[k].j == j) return &values_[sorted_[k].first];
  return nullptr;
}

namespace {

// Room for `more` pairs and the padding of the last pack.
void reserve(PairContacts& group, std::size_t more) {
  const auto needed = group.size + more + lanes;
  if (group.i.size() >= needed) return;
  const auto room = std::max(needed, group.i.size() * 3 / 2);
  group.i.resize(room);
  group.j.resize(room);
  group.slot.resize(room);
}

void pad(PairContacts& group) {
  if (group.size == 0) return;
  for (auto c = group.size; c % lanes != 0; ++c) {
    group.i[c] = group.i[group.size - 1];
    group.j[c] = group.j[group.size - 1];
  }
}

std::size_t packs(const PairContacts& group) { return (group.size + lanes - 1) / lanes; }

void copy_history(const PairContacts& from, std::size_t a, PairContacts& to, std::size_t b, std::size_t numbers) {
  const auto* source = &from.history[a / lanes * numbers];
  auto* target = &to.history[b / lanes * numbers];
  for (std::size_t n = 0; n < numbers; ++n) target[n].value[b % lanes] = source[n].value[a % lanes];
}

}  // namespace

void TouchingPairs::refresh(const Particles& particles, const PairList& rows, std::uint32_t first, std::uint32_t last, double skin,
                            const KernelTable& kernels, bool one_material, const SavedPairs* saved) {
  groups_.resize(2 * kernels.kernel.size());
  groups_.swap(earlier_);
  groups_.resize(2 * kernels.kernel.size());
  for (auto& group : groups_) group.size = 0;
  const Record* const position = particles.position.data();
  const std::uint32_t* const second = rows.second.data();
  const auto append = [](PairContacts& group, std::uint32_t i, std::uint32_t j, std::uint32_t slot, bool touches) {
    // Written in any case and counted only where it touches: no branch to mispredict.
    group.i[group.size] = i;
    group.j[group.size] = j;
    group.slot[group.size] = slot;
    group.size += touches;
  };
  const std::size_t only = one_material && first < last ? 2u * kernels.group[particles.material[first] * (kernels.materials + 1)] : 0;
  for (std::uint32_t i = first; i < last; ++i) {
    const Record a = position[i];
    const double wide = a.w + skin;
    const auto begin = rows.start[i - first], end = rows.start[i - first + 1];
    const auto touches = [&](std::uint32_t j) {
      const Record& b = position[j];
      const double dx = a.x - b.x, dy = a.y - b.y, dz = a.z - b.z, reach = wide + b.w;
      return dx * dx + dy * dy + dz * dz < reach * reach;
    };
    // Rows are ascending: the pairs of this partition come first.
    auto k = begin;
    if (one_material) {
      auto &own = groups_[only], &other = groups_[only + 1];
      reserve(own, end - begin);
      for (; k < end && second[k] < last; ++k) append(own, i, second[k], k, touches(second[k]));
      reserve(other, end - k);
      for (; k < end; ++k) append(other, i, second[k], k, touches(second[k]));
    } else {
      const auto* const row = &kernels.group[particles.material[i] * kernels.materials];
      for (; k < end; ++k) {
        const auto j = second[k];
        auto& group = groups_[2u * row[particles.material[j]] + (j >= last)];
        reserve(group, 1);
        append(group, i, j, k, touches(j));
      }
    }
  }
  export_count_ = 0;
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    auto& group = groups_[g];
    pad(group);
    group.exports = g % 2 == 1;
    if (group.exports) {
      group.first_export = export_count_;
      export_count_ += group.size;
    }
    const auto* kernel = kernels.kernel[g / 2].get();
    const auto numbers = kernel ? kernel->history_size() : 0;
    group.history.assign(packs(group) * numbers, HistoryLane{});
    if (numbers == 0) continue;
    if (saved) {
      for (std::size_t c = 0; c < group.size; ++c)
        if (const double* values = saved->find(group.i[c], group.j[c]))
          for (std::size_t n = 0; n < numbers; ++n) group.history[c / lanes * numbers + n].value[c % lanes] = values[n];
    } else {
      const auto& earlier = earlier_[g];
      std::size_t e = 0;
      for (std::size_t c = 0; c < group.size; ++c) {
        while (e < earlier.size && earlier.slot[e] < group.slot[c]) ++e;
        if (e < earlier.size && earlier.slot[e] == group.slot[c]) copy_history(earlier, e, group, c, numbers);
      }
    }
  }
  exports.force.resize(export_count_);
  if (particles.has_spins()) exports.torque.resize(export_count_);
}

void TouchingPairs::save(SavedPairs& saved, const KernelTable& kernels) const {
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const auto* kernel = kernels.kernel[g / 2].get();
    const auto numbers = kernel ? kernel->history_size() : 0;
    if (numbers == 0) continue;
    const auto& group = groups_[g];
    for (std::size_t c = 0; c < group.size; ++c)
      saved.add(group.i[c], group.j[c], g / 2, &group.history[c / lanes * numbers], numbers, c % lanes);
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
  std::size_t bytes = 0;
  for (const auto& group : groups_) bytes += group.size * 3 * sizeof(std::uint32_t) + group.history.size() * sizeof(HistoryLane);
  return bytes;
}

}  // namespace acopla::dem
