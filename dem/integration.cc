#include "dem/integration.h"

#include <cmath>

#include "dem/simd.h"

namespace acopla::dem {
namespace {

using Four = RecordVector;

template <int dimension, bool spins, bool moves>
Travel advance(Particles& particles, const Vec3& gravity, double kick, double step, std::uint32_t first, std::uint32_t last) {
  constexpr bool plane = dimension == 2;
  // A disc's third component is its angle, which nobody needs; the fourth is the radius or the mass, to which nothing is added.
  const Four g = kick * Four{gravity[0], gravity[1], plane ? 0 : gravity[2], 0};
  const Four shift{step, step, plane ? 0 : step, 0};
  Four farthest{}, sum{};
  for (auto i = first; i < last; ++i) {
    auto& x = as_vector(particles.position[i]);
    auto& v = as_vector(particles.velocity[i]);
    auto& force = as_vector(particles.force[i]);
    const double inverse = kick / particles.velocity[i].w;
    const double turn = plane ? 2 * inverse / (particles.position[i].w * particles.position[i].w) : inverse;
    const Four velocity = v + force * Four{inverse, inverse, turn, 0} + g;
    v = velocity;
    if constexpr (moves) {
      const Four moved = velocity * shift;
      x += moved;
      const Four length = moved < 0 ? -moved : moved;
      farthest = length > farthest ? length : farthest;
      sum += moved;
      force = Four{};
    }
  }
  if constexpr (spins)
    for (auto i = first; i < last; ++i) {
      auto& torque = as_vector(particles.torque[i]);
      as_vector(particles.spin[i]) += torque * (kick / particles.spin[i].w);
      if constexpr (moves) torque = Four{};
    }
  return {std::sqrt(farthest[0] * farthest[0] + farthest[1] * farthest[1] + farthest[2] * farthest[2]),
          std::isfinite(sum[0]) && std::isfinite(sum[1]) && std::isfinite(sum[2])};
}

template <bool moves>
Travel advance_any(Particles& particles, const Vec3& gravity, double kick, double step, std::uint32_t first, std::uint32_t last) {
  if (particles.kind.dimension == 2) return advance<2, false, moves>(particles, gravity, kick, step, first, last);
  if (particles.has_spins()) return advance<3, true, moves>(particles, gravity, kick, step, first, last);
  return advance<3, false, moves>(particles, gravity, kick, step, first, last);
}

}  // namespace

Travel move(Particles& particles, const Vec3& gravity, double kick, double step, std::uint32_t first, std::uint32_t last) {
  return advance_any<true>(particles, gravity, kick, step, first, last);
}
void kick(Particles& particles, const Vec3& gravity, double kick, std::uint32_t first, std::uint32_t last) {
  advance_any<false>(particles, gravity, kick, 0, first, last);
}

}  // namespace acopla::dem
