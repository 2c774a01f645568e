#include "dem/feeding/insertion.h"

#include "dem/feeding/fill.h"

namespace acopla::dem {

Particles insert_particles(const Scene& scene, const WallSet& walls, bool rotates) {
  std::vector<Filling> fillings;
  for (const auto& insertion : scene.insertions) {
    Filling filling;
    filling.name = "the insertion";
    filling.material = insertion.material;
    filling.sizes = SizeDistribution::one(2 * insertion.radius, 3);
    filling.region = Region::box(insertion.low, insertion.high, 3);
    filling.count = insertion.count;
    filling.velocity = insertion.velocity;
    filling.where = insertion.where;
    fillings.push_back(filling);
  }
  FillSettings settings{3, scene.gravity, scene.seed, {}};
  settings.vacant = [&, near = std::vector<std::uint32_t>()](const Vec3& at, double radius) mutable {
    near.clear();
    walls.find_near(at, radius * (1 - 1e-9), near);
    return near.empty();
  };
  Particles particles;
  particles.rotates = rotates;
  for (const auto& one : fill(fillings, settings))
    particles.add(one.at, one.radius, scene.materials[one.material].density, one.material, one.velocity);
  return particles;
}

}  // namespace acopla::dem
