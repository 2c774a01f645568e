#include "dem/integration.h"

#include <cmath>

#include "dem/simd.h"

namespace acopla::dem {
namespace {

using Four = Double4::Vector;

Four absolute(const Four& v) { return v < 0 ? -v : v; }

enum class Part { drift, kick, both };

template <int dimension, bool spins, Part part>
Travel advance(Particles& particles, const Vec3& gravity, double step, std::uint32_t first, std::uint32_t last) {
  constexpr bool plane = dimension == 2;
  const double half_square = 0.5 * step * step, half_step = 0.5 * step;
  const Four g{gravity[0], gravity[1], plane ? 0 : gravity[2], 0};
  // A disc's third component is its angle, which nobody needs; the fourth is the radius or the mass.
  const Four whole{step, step, plane ? 0 : step, 0}, half{half_square, half_square, plane ? 0 : half_square, 0};
  Four farthest{}, sum{};
  for (auto i = first; i < last; ++i) {
    auto& x = as_vector(particles.position[i]);
    auto& v = as_vector(particles.velocity[i]);
    const double inverse = 1 / particles.velocity[i].w;
    const double turn = plane ? 2 * inverse / (particles.position[i].w * particles.position[i].w) : inverse;
    const Four per_mass{inverse, inverse, turn, 0};
    auto& earlier = as_vector(particles.earlier_force[i]);
    Four speed = v, acceleration;
    if constexpr (part == Part::drift) {
      acceleration = earlier * per_mass + g;
    } else {
      const Four force = as_vector(particles.force[i]);
      speed += (force - earlier) * per_mass * half_step;
      acceleration = force * per_mass + g;
    }
    if constexpr (part != Part::kick) {
      const Four moved = speed * whole + acceleration * half;
      x += moved;
      farthest = absolute(moved) > farthest ? absolute(moved) : farthest;
      sum += moved;
      speed += acceleration * step;
    }
    if constexpr (part != Part::drift) earlier = Four{};
    v = speed;  // the mass is in a lane that nothing was added to
  }
  if constexpr (spins)
    for (auto i = first; i < last; ++i) {
      auto& w = as_vector(particles.spin[i]);
      auto& earlier = as_vector(particles.earlier_torque[i]);
      const double inverse = 1 / particles.spin[i].w;
      Four spin = w;
      if constexpr (part == Part::drift) {
        spin += earlier * (inverse * step);
      } else {
        const Four torque = as_vector(particles.torque[i]);
        spin += (torque - earlier) * (inverse * half_step);
        if constexpr (part == Part::both) spin += torque * (inverse * step);
        earlier = Four{};
      }
      w = spin;
    }
  return {std::sqrt(farthest[0] * farthest[0] + farthest[1] * farthest[1] + farthest[2] * farthest[2]),
          std::isfinite(sum[0]) && std::isfinite(sum[1]) && std::isfinite(sum[2])};
}

template <Part part>
Travel advance_any(Particles& particles, const Vec3& gravity, double step, std::uint32_t first, std::uint32_t last) {
  if (particles.kind.dimension == 2) return advance<2, false, part>(particles, gravity, step, first, last);
  if (particles.has_spins()) return advance<3, true, part>(particles, gravity, step, first, last);
  return advance<3, false, part>(particles, gravity, step, first, last);
}

}  // namespace

Travel drift(Particles& particles, const Vec3& gravity, double step, std::uint32_t first, std::uint32_t last) {
  return advance_any<Part::drift>(particles, gravity, step, first, last);
}
void kick(Particles& particles, double step, std::uint32_t first, std::uint32_t last) {
  advance_any<Part::kick>(particles, Vec3::Zero(), step, first, last);
}
Travel kick_drift(Particles& particles, const Vec3& gravity, double step, std::uint32_t first, std::uint32_t last) {
  return advance_any<Part::both>(particles, gravity, step, first, last);
}

}  // namespace acopla::dem
