#include "dem/insertion.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <unordered_map>

namespace acopla::dem {
namespace {

// Spheres placed so far, hashed by cells of the largest diameter.
class Occupancy {
 public:
  explicit Occupancy(double largest_radius) : edge_(2 * largest_radius) {}

  bool is_free(const Vec3& at, double radius) const {
    const auto cell = cell_of(at);
    for (std::int64_t z = -1; z <= 1; ++z)
      for (std::int64_t y = -1; y <= 1; ++y)
        for (std::int64_t x = -1; x <= 1; ++x) {
          const auto found = cells_.find(key(cell[0] + x, cell[1] + y, cell[2] + z));
          if (found == cells_.end()) continue;
          for (const auto& other : found->second) {
            const double reach = radius + other.w;
            if ((at - other.vector()).squaredNorm() < reach * reach) return false;
          }
        }
    return true;
  }

  void add(const Vec3& at, double radius) {
    const auto cell = cell_of(at);
    cells_[key(cell[0], cell[1], cell[2])].push_back({at[0], at[1], at[2], radius});
  }

 private:
  std::array<std::int64_t, 3> cell_of(const Vec3& at) const {
    return {static_cast<std::int64_t>(std::floor(at[0] / edge_)), static_cast<std::int64_t>(std::floor(at[1] / edge_)),
            static_cast<std::int64_t>(std::floor(at[2] / edge_))};
  }
  static std::uint64_t key(std::int64_t x, std::int64_t y, std::int64_t z) {
    // 21 bits each: a million diameters either way.
    const auto part = [](std::int64_t v) { return static_cast<std::uint64_t>(v + (1 << 20)) & 0x1fffff; };
    return part(x) | part(y) << 21 | part(z) << 42;
  }
  double edge_;
  std::unordered_map<std::uint64_t, std::vector<Record>> cells_;
};

[[noreturn]] void no_room(const Insertion& insertion, std::size_t placed) {
  const double volume = (insertion.high - insertion.low).prod();
  const double solid = static_cast<double>(insertion.count) * 4.0 / 3.0 * M_PI * std::pow(insertion.radius, 3) / volume;
  throw io::UserError(insertion.where,
                      fmt::format("only {} of {} spheres of {:.4g} m find a place in the region: they would fill {:.0f} % of it, and "
                                  "random placing without overlap ends near 30 %. Enlarge the region or lower the count.",
                                  placed, insertion.count, 2 * insertion.radius, 100 * solid));
}

}  // namespace

Particles insert_particles(const Scene& scene, const WallSet& walls) {
  Particles particles;
  particles.kind = scene.kind();
  Random random(scene.seed);
  std::vector<const Insertion*> order;
  for (const auto& insertion : scene.insertions) order.push_back(&insertion);
  std::stable_sort(order.begin(), order.end(), [](const auto* a, const auto* b) { return a->radius > b->radius; });
  Occupancy occupancy(order.front()->radius);
  std::vector<std::uint32_t> near;
  for (const auto* insertion : order) {
    const Vec3 low = insertion->low + Vec3::Constant(insertion->radius);
    const Vec3 size = insertion->high - insertion->low - Vec3::Constant(2 * insertion->radius);
    for (std::size_t placed = 0; placed < insertion->count; ++placed) {
      Vec3 at;
      bool fits = false;
      for (int tries = 0; tries < 20000 && !fits; ++tries) {
        at = low + size.cwiseProduct(Vec3(random.uniform(), random.uniform(), random.uniform()));
        if (!occupancy.is_free(at, insertion->radius)) continue;
        near.clear();
        walls.find_near(at, insertion->radius * (1 - 1e-9), near);
        fits = near.empty();
      }
      if (!fits) no_room(*insertion, placed);
      occupancy.add(at, insertion->radius);
      particles.add(at, insertion->radius, scene.materials[insertion->material].density, insertion->material, insertion->velocity);
    }
  }
  return particles;
}

}  // namespace acopla::dem
