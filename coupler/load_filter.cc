#include "coupler/load_filter.h"

#include <string>
#include <vector>

namespace acopla::coupler {

using geometry::Vec3;

namespace {

void add(LoadFilter::Forces& sum, const LoadFilter::Forces& forces, double share) {
  for (const auto& [surface, values] : forces) {
    auto& load = sum[surface];
    if (load.empty()) load.assign(values.size(), Vec3::Zero());
    for (std::size_t k = 0; k < values.size(); ++k) load[k] += share * values[k];
  }
}

void raise(LoadFilter::Forces& peak, const LoadFilter::Forces& forces) {
  for (const auto& [surface, values] : forces) {
    auto& load = peak[surface];
    if (load.empty()) load.assign(values.size(), Vec3::Zero());
    for (std::size_t k = 0; k < values.size(); ++k)
      if (values[k].squaredNorm() > load[k].squaredNorm()) load[k] = values[k];
  }
}

void write_forces(io::StateWriter& writer, const std::string& name, const LoadFilter::Forces& forces) {
  std::vector<std::string> surfaces;
  for (const auto& [surface, values] : forces) surfaces.push_back(surface);
  writer(name + ".surfaces", surfaces);
  for (const auto& [surface, values] : forces) writer(name + "." + surface, values);
}

LoadFilter::Forces read_forces(io::StateReader& reader, const std::string& name) {
  LoadFilter::Forces forces;
  std::vector<std::string> surfaces;
  reader(name + ".surfaces", surfaces);
  for (const auto& surface : surfaces) reader(name + "." + surface, forces[surface]);
  return forces;
}

}  // namespace

std::int64_t LoadFilter::spans() const { return by_window() ? case_.windows - case_.loads_from : 1; }

std::pair<std::int64_t, std::int64_t> LoadFilter::span(std::int64_t index) const {
  if (!by_window()) return {case_.load_start, case_.load_end};
  return {case_.loads_from + index, case_.loads_from + index + 1};
}

std::int64_t LoadFilter::span_of(std::int64_t window) const {
  if (by_window()) return window >= case_.loads_from ? window - case_.loads_from : -1;
  return window >= case_.load_start && window < case_.load_end ? 0 : -1;
}

void LoadFilter::take(std::int64_t window, Forces forces) {
  const auto index = span_of(window);
  if (case_.loads == Loads::running_mean) {
    recent_.push_back(std::move(forces));
    if (std::ssize(recent_) > case_.load_windows) recent_.pop_front();
    if (index < 0) return;
    // Summed anew: a sum that is carried along would gather rounding.
    for (const auto& each : recent_) add(loads_[index], each, 1.0 / static_cast<double>(recent_.size()));
    return;
  }
  if (index < 0) return;
  if (case_.loads == Loads::history) {
    loads_[index] = std::move(forces);
  } else if (case_.loads == Loads::peak) {
    raise(loads_[index], forces);
  } else {
    const auto [start, end] = span(index);
    add(loads_[index], forces, 1.0 / static_cast<double>(end - start));
  }
}

void LoadFilter::write(io::StateWriter& writer) const {
  std::vector<std::int64_t> indices;
  for (const auto& [index, forces] : loads_) indices.push_back(index);
  writer("loads", indices);
  for (const auto& [index, forces] : loads_) write_forces(writer, "load" + std::to_string(index), forces);
  writer("recent", static_cast<std::uint64_t>(recent_.size()));
  for (std::size_t k = 0; k < recent_.size(); ++k) write_forces(writer, "recent" + std::to_string(k), recent_[k]);
}

void LoadFilter::read(io::StateReader& reader) {
  std::vector<std::int64_t> indices;
  std::uint64_t recent = 0;
  reader("loads", indices);
  for (const auto index : indices) loads_[index] = read_forces(reader, "load" + std::to_string(index));
  reader("recent", recent);
  for (std::uint64_t k = 0; k < recent; ++k) recent_.push_back(read_forces(reader, "recent" + std::to_string(k)));
}

}  // namespace acopla::coupler
