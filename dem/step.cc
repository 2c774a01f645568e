#include "dem/step.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "dem/contact/linear_slider.h"

namespace acopla::dem {

CriticalStep critical_step(const Scene& scene) {
  CriticalStep critical{std::numeric_limits<double>::infinity(), ""};
  const auto consider = [&](double seconds, std::string reason) {
    if (seconds < critical.seconds) critical = {seconds, std::move(reason)};
  };
  // A dashpot shortens the step: leapfrog with the closing speed extrapolated to the whole step is stable while h² + 8 ζ h ≤ 4, h = ω Δt.
  const auto share_left = [](double zeta) { return std::sqrt(1 + 4 * zeta * zeta) - 2 * zeta; };
  for (const auto of : scene.particle_materials()) {
    const auto& material = scene.materials[of];
    const double radius = scene.smallest_radius(of);
    if (material.shear_modulus > 0) {
      // The Rayleigh time says nothing of dashpots. A fifth of it leaves room for those of e = 0.7; stronger ones take their share: a bed of
      // e = 0.3 settles at 0.13 of the Rayleigh time with a step_ratio of 0.8, at 0.2 with 1.1.
      double room = 1;
      for (std::size_t other = 0; other < scene.materials.size(); ++other)
        room = std::min(room, 1.5 * share_left(scene.pair(of, other).hertz_damping / 2));
      consider(room * M_PI * radius * std::sqrt(material.density / material.shear_modulus) / (0.1631 * material.poisson + 0.8766),
               fmt::format("Rayleigh time of {} {} of {:.4g} m{}", material.name, scene.dimension == 2 ? "discs" : "spheres",
                           2 * radius, room < 1 ? ", shortened for the dashpots" : ""));
    }
    const double mass = material.density * volume_of(scene.dimension, radius);
    for (std::size_t other = 0; other < scene.materials.size(); ++other) {
      const auto& pair = scene.pair(of, other);
      if (pair.stiffness <= 0) continue;
      // A dense packing, its stiffness spread over all directions: twelve spheres or six discs around one. It moves, or it turns against
      // its tangential springs; m r²/I is 5/2 for spheres and 2 for discs.
      const double contacts = scene.dimension == 2 ? 6 : 12, turning = scene.dimension == 2 ? 2 : 2.5;
      const double shear = pair.laws.tangential == LinearSlider::name ? pair.stiffness / pair.tangential_values[0] : 0;
      const double across = scene.dimension - 1;
      const double moving = (pair.stiffness + across * shear) / scene.dimension, rolling = turning * across / scene.dimension * shear;
      const double omega = std::sqrt(2 * contacts * std::max(moving, rolling) / mass);
      consider(2 / omega * share_left(std::sqrt(contacts / scene.dimension) * pair.damping_ratio),
               fmt::format("springs of {} {} of {:.4g} m against {}", material.name, scene.dimension == 2 ? "discs" : "spheres",
                           2 * radius, scene.materials[other].name));
    }
  }
  return critical;
}

double largest_step(const Scene& scene, const io::Table& table) {
  const auto critical = critical_step(scene);
  if (!scene.step) return scene.step_fraction * critical.seconds;
  if (*scene.step > critical.seconds && !scene.allow_unstable_step)
    table.fail("step", fmt::format("= {:.4g} s is above the critical step of {:.4g} s ({}). Use at most {:.4g} s, or say "
                                   "allow_unstable_step = true.", *scene.step, critical.seconds, critical.reason, 0.2 * critical.seconds));
  return *scene.step;
}

}  // namespace acopla::dem
