#include "dem/traffic.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "dem/feeding/insertion.h"
#include "dem/feeding/occupancy.h"

namespace acopla::dem {

Traffic::Traffic(const Scene& scene) : outlets_(scene.outlets) {
  for (const auto& inlet : scene.inlets) feeds_.emplace_back(inlet);
}

std::uint64_t Traffic::steps_between(double step) const {
  double steps = outlets_.empty() ? 1e9 : 100;
  for (const auto& feed : feeds_) {
    const double particle = feed.inlet().density * feed.inlet().sizes.mean_volume();
    steps = std::min(steps, std::max(20.0, particle / feed.inlet().rate / step));
  }
  return static_cast<std::uint64_t>(steps);
}

void Traffic::visit(Engine& engine) {
  const auto& particles = engine.particles();
  if (!outlets_.empty()) {
    std::vector<bool> gone(particles.size(), false);
    for (auto& outlet : outlets_)
      for (const auto i : outlet.leaving(
               particles.size(), [&](std::size_t k) { return particles.position[k].vector(); }, [&](std::size_t k) { return particles.mass_of(k); }))
        gone[i] = true;
    engine.remove([&](std::size_t i) { return gone[i]; });
  }
  for (auto& feed : feeds_) {
    // Who is near the inlet's region is in the way.
    const auto& region = feed.inlet().region;
    const auto box = region.bounds();
    Occupancy taken(region.dimension(), feed.inlet().sizes.largest_radius());
    for (std::size_t i = 0; i < particles.size(); ++i) {
      const Vec3 at = particles.position[i].vector();
      const double reach = particles.radius_of(i);
      if (((at - box.low).array() > -reach).all() && ((box.high - at).array() > -reach).all()) taken.add(at, reach);
    }
    const auto clear = clear_of(engine.walls());
    engine.insert(feed.due(engine.time(), [&](const Vec3& at, double radius) { return taken.is_free(at, radius) && clear(at, radius); }));
  }
}

void Traffic::quantities(std::vector<std::pair<std::string, double>>& values) const {
  for (std::size_t k = 0; k < feeds_.size(); ++k) {
    values.emplace_back(fmt::format("inlet{}.mass", k), feeds_[k].state().delivered);
    values.emplace_back(fmt::format("inlet{}.backlog", k), feeds_[k].backlog());
  }
  for (std::size_t k = 0; k < outlets_.size(); ++k) {
    const auto name = outlets_[k].name.empty() ? fmt::format("outlet{}", k) : outlets_[k].name;
    values.emplace_back(name + ".mass", outlets_[k].mass);
    values.emplace_back(name + ".count", static_cast<double>(outlets_[k].count));
  }
}

std::vector<std::string> Traffic::warnings() const {
  std::vector<std::string> sentences;
  for (const auto& feed : feeds_)
    if (const auto warning = feed.warning()) sentences.push_back(*warning);
  return sentences;
}

}  // namespace acopla::dem
