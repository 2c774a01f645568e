#include "dem/step.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "dem/laws.h"

namespace acopla::dem {

namespace {

// What a mode's eigenvalue of Δt² K + 2 Δt (2 C_n + C_t) over its mass has of the square of the step, of the step, and of neither.
struct Mode {
  double square = 0, once = 0, fixed = 0;
  void cover(const Mode& other) {
    square = std::max(square, other.square);
    once = std::max(once, other.once);
    fixed = std::max(fixed, other.fixed);
  }
  Mode operator+(const Mode& other) const { return {square + other.square, once + other.once, fixed + other.fixed}; }
  // Where the eigenvalue reaches 4 (dem/stability.h).
  double limit() const {
    const double left = 4 - fixed;
    return square + once > 0 && left > 0 ? 2 * left / (once + std::sqrt(once * once + 4 * left * square)) : std::numeric_limits<double>::infinity();
  }
};

// A particle amid contacts in all directions, whose neighbours move against it: it is displaced, it turns as they turn, or against them.
struct Neighbourhood {
  Mode moves, turns_along, turns_against;
  Neighbourhood() = default;
  /// @param weight  the contacts, those with particles counted twice
  Neighbourhood(const ContactStiffness& c, double weight, double inertia_share, int dimension, double mass, double inertia, double radius) {
    // Means over the directions: of n n, of the part of a spin that slips, and of those that roll and twist.
    const bool plane = dimension == 2;
    const double along = 1.0 / dimension, across = 1 - along, slips = plane ? 1.0 : 2.0 / 3, rolls = plane ? 1.0 : (2 + c.twisting) / 3;
    moves = {weight * (along * c.normal + across * c.shear) / mass, 2 * weight * (2 * along * c.normal_dashpot + across * c.shear_dashpot) / mass, 0};
    turns_along = {weight * slips * radius * radius * c.shear / inertia, 2 * weight * slips * radius * radius * c.shear_dashpot / inertia, 0};
    turns_against = {weight * rolls * c.rolling / inertia, 2 * weight * rolls * c.rolling_dashpot / inertia, 2 * weight * c.spin_share * inertia_share};
  }
  void cover(const Neighbourhood& other) {
    moves.cover(other.moves);
    turns_along.cover(other.turns_along);
    turns_against.cover(other.turns_against);
  }
};

// The limit of a particle of a material in a dense packing of its like in a corner of walls, at an overlap over its radius.
double limit_in_packing(const Scene& scene, std::size_t of, double overlap) {
  const auto used = scene.particle_materials();
  const double r = scene.smallest_radius(of), m = scene.materials[of].density * volume_of(scene.dimension, r);
  const double inertia = (scene.dimension == 2 ? 0.5 : 0.4) * m * r * r, rolling = inertia + m * r * r;
  Neighbourhood particles, walls;
  for (std::size_t other = 0; other < scene.materials.size(); ++other) {
    const auto& pair = scene.pair(of, other);
    if (pair.laws.normal.empty()) continue;
    const auto kernel = scene.laws->make(pair, scene.dimension);
    if (std::find(used.begin(), used.end(), other) != used.end()) {
      // Twelve spheres or six discs around one.
      const double contacts = scene.dimension == 2 ? 6 : 12;
      particles.cover({kernel->stiffness(overlap * r, r / 2, m / 2, rolling / 2), 2 * contacts, 0.5, scene.dimension, m, inertia, r});
    } else {
      walls.cover({kernel->stiffness(overlap * r, r, m, rolling), static_cast<double>(scene.dimension), 1, scene.dimension, m, inertia, r});
    }
  }
  return std::min({(particles.moves + walls.moves).limit(), (particles.turns_along + walls.turns_along).limit(),
                   (particles.turns_against + walls.turns_against).limit()});
}

}  // namespace

CriticalStep critical_step(const Scene& scene) {
  CriticalStep critical{std::numeric_limits<double>::infinity(), ""};
  const auto consider = [&](double seconds, std::string reason) {
    if (seconds < critical.seconds) critical = {seconds, std::move(reason)};
  };
  for (const auto of : scene.particle_materials()) {
    const auto& material = scene.materials[of];
    const double radius = scene.smallest_radius(of);
    if (!(radius > 0)) continue;
    const auto particles = fmt::format("{} {} of {:.4g} m", material.name, scene.dimension == 2 ? "discs" : "spheres", 2 * radius);
    bool hertz = false;
    // An impact with a strong dashpot needs shorter steps than the Rayleigh time says: with these a fifth of it keeps e within 0.0125.
    double room = 1;
    for (std::size_t other = 0; other < scene.materials.size(); ++other) {
      const auto& pair = scene.pair(of, other);
      if (pair.laws.normal != Hertz::name) continue;
      hertz = true;
      const double zeta = pair.hertz_damping / 2;
      room = std::min(room, 1.5 * (std::sqrt(1 + 4 * zeta * zeta) - 2 * zeta));
    }
    if (material.shear_modulus > 0)
      consider(room * M_PI * radius * std::sqrt(material.density / material.shear_modulus) / (0.1631 * material.poisson + 0.8766),
               fmt::format("Rayleigh time of {}{}", particles, room < 1 ? ", shortened for the dashpots" : ""));
    if (hertz) consider(5 * limit_in_packing(scene, of, 0.01), "five times the limit of " + particles + " squeezed by 1 % of their radius");
    else consider(limit_in_packing(scene, of, 0.05), "springs and dashpots of a dense packing of " + particles);
  }
  return critical;
}

bool watches_energy(const Scene& scene, double step) {
  return !scene.allow_unstable_step && step >= 0.5 * (1 - 1e-12) * critical_step(scene).seconds;
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
