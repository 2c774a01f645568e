#include "dem/feeding/insertion.h"

namespace acopla::dem {

Vacancy clear_of(const WallSet& walls) {
  return [&walls, near = std::vector<std::uint32_t>()](const Vec3& at, double radius) mutable {
    near.clear();
    walls.find_near(at, radius * (1 - 1e-9), near);
    return near.empty();
  };
}

Particles insert_particles(const Scene& scene, const WallSet& walls) {
  auto settings = scene.fill_settings();
  settings.vacant = clear_of(walls);
  Particles particles;
  particles.kind = scene.kind();
  for (const auto& one : fill(scene.fillings, settings))
    particles.add(one.at, one.radius, scene.materials[one.material].density, one.material, one.velocity, one.spin);
  return particles;
}

}  // namespace acopla::dem
