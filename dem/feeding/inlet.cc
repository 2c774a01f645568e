#include "dem/feeding/inlet.h"

#include <fmt/format.h>

#include <algorithm>

namespace acopla::dem {
namespace {

// As many tries as find a hole of one part in a hundred of the region, but for one time in e^20.
constexpr int tries = 2000;

}  // namespace

InletFeed::InletFeed(Inlet inlet) : inlet_(std::move(inlet)) { state_.random = Random(inlet_.seed).state(); }

double InletFeed::owed(double time) const {
  const double open = std::max(0.0, std::min(time, inlet_.until) - inlet_.from);
  return inlet_.rate * open - state_.delivered;
}

double InletFeed::backlog() const { return choked() ? std::max(0.0, owed(state_.time)) : 0; }

std::vector<NewParticle> InletFeed::due(double time, const Vacancy& vacant) {
  std::vector<NewParticle> particles;
  const int dimension = inlet_.region.dimension();
  Occupancy occupancy(dimension, inlet_.sizes.largest_radius());
  Random random(state_.random);
  state_.time = time;
  bool refused = false;
  while (owed(time) > 0) {
    if (state_.next_radius == 0) state_.next_radius = inlet_.sizes.draw_next(state_.delivered_of_class, random);
    const double radius = state_.next_radius, mass = inlet_.density * particle_volume(radius, dimension);
    if (owed(time) < mass / 2) break;
    Vec3 at;
    if (!place_at_random(inlet_.region, radius, occupancy, vacant, random, tries, at)) {
      refused = true;
      break;
    }
    occupancy.add(at, radius);
    particles.push_back({at, radius, inlet_.velocity, inlet_.spin, inlet_.material});
    state_.delivered += mass;
    ++state_.count;
    state_.next_radius = 0;
  }
  if (refused) {
    ++state_.refusals;
    if (!choked()) state_.choked_since = time;
    state_.largest_backlog = std::max(state_.largest_backlog, owed(time));
  } else {
    state_.choked_since = -1;
  }
  state_.random = random.state();
  return particles;
}

std::optional<std::string> InletFeed::warning() const {
  if (!choked()) return std::nullopt;
  return fmt::format(
      "{} is choked since {:.6g} s: {:.4g} kg wait for room in {}. They are not lost and come when there is room. Lower the "
      "rate, raise the velocity with which particles leave the region, or enlarge it.",
      inlet_.name, state_.choked_since, backlog(), inlet_.region.text());
}

}  // namespace acopla::dem
