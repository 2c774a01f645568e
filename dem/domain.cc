#include "dem/domain.h"

#include <algorithm>

namespace acopla::dem {

geometry::Box domain_of(const Scene& scene, const Particles& particles, const WallSet& walls) {
  if (scene.domain) return *scene.domain;
  Vec3 low = Vec3::Constant(1e300), high = -low;
  const auto include = [&](const Vec3& a, const Vec3& b) {
    low = low.cwiseMin(a);
    high = high.cwiseMax(b);
  };
  double largest = 0;
  for (const auto& box : scene.regions()) include(box.low, box.high);
  for (const auto& p : particles.position) {
    include(p.vector(), p.vector());
    largest = std::max(largest, p.w);
  }
  if (const auto box = walls.bounds()) include(box->low, box->high);
  if (!(low[0] <= high[0])) include(Vec3::Zero(), Vec3::Zero());
  const Vec3 margin = Vec3::Constant(0.5 * (high - low).maxCoeff() + 10 * largest);
  return {low - margin, high + margin};
}

}  // namespace acopla::dem
