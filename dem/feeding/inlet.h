// Particles that come and go while time runs: a mass flow in, and what leaves through a region.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "dem/feeding/fill.h"
#include "io/error.h"

namespace acopla::dem {

/// One [[X.inlet]]: a constant mass flow of particles that appear at random places of a region.
struct Inlet {
  std::string name;  ///< of the table, for messages
  std::uint8_t material = 0;
  double density = 0;                                      ///< [kg/m³]
  double rate = 0;                                         ///< [kg/s]; 2D: per metre of depth
  double from = 0;                                         ///< [s]
  double until = std::numeric_limits<double>::infinity();  ///< [s]
  SizeDistribution sizes;
  Region region;                                      ///< whole particles inside; it must hold the largest
  Vec3 velocity = Vec3::Zero(), spin = Vec3::Zero();  ///< of every particle [m/s], [rad/s]
  std::uint64_t seed = 1;
  io::Location where;
};

/// All that an inlet remembers: plain numbers, to be saved and set.
struct InletState {
  std::uint64_t random = 0;
  double next_radius = 0;                  ///< drawn and waiting for its turn [m]; 0: none
  std::vector<double> delivered_of_class;  ///< volume by class of sizes [m³]
  double delivered = 0;                    ///< mass so far [kg]
  std::uint64_t count = 0;                 ///< particles so far
  std::uint64_t refusals = 0;              ///< calls of due() that ended with a particle that found no room
  double largest_backlog = 0;              ///< most mass that was ever due and found no room [kg]
  double choked_since = -1;                ///< time of the first refusal of the present choke [s]; −1: not choked
  double time = 0;                         ///< of the last call [s]
  bool operator==(const InletState&) const = default;

  template <class Archive>
  void state(Archive& archive) {
    archive("random", random);
    archive("next_radius", next_radius);
    archive("delivered_of_class", delivered_of_class);
    archive("delivered", delivered);
    archive("count", count);
    archive("refusals", refusals);
    archive("largest_backlog", largest_backlog);
    archive("choked_since", choked_since);
    archive("time", time);
  }
};

/// Delivers an inlet's particles when they are due. The mass delivered is rate × time rounded to whole particles: never off by more
/// than half of the particle that comes next. Where the region is full, the mass stays owed and comes as soon as there is
/// room, after `until` if need be; sizes are not chosen again for that.
class InletFeed {
 public:
  explicit InletFeed(Inlet inlet);

  /// The particles that are due by `time` [s] and were not delivered yet, clear of each other and of what `vacant` knows.
  std::vector<NewParticle> due(double time, const Vacancy& vacant);

  /// Mass that is due and waits for room [kg].
  double backlog() const;
  bool choked() const { return state_.choked_since >= 0; }
  /// While choked: a sentence that says what waits since when, and what to change.
  std::optional<std::string> warning() const;

  const Inlet& inlet() const { return inlet_; }
  const InletState& state() const { return state_; }
  void restore(const InletState& state) { state_ = state; }

 private:
  double owed(double time) const;
  Inlet inlet_;
  InletState state_;
};

/// One [[X.outlet]]: particles whose centre is in the region leave; their mass and number are counted.
struct Outlet {
  std::string name;
  Region region;
  double mass = 0;  ///< gone so far [kg]
  std::uint64_t count = 0;

  /// Indices, ascending, of those of `size` particles that leave now; counts them.
  /// @param at, mass_of  centre [m] and mass [kg] of a particle by index
  template <class At, class MassOf>
  std::vector<std::uint32_t> leaving(std::size_t size, At&& at, MassOf&& mass_of) {
    std::vector<std::uint32_t> gone;
    for (std::size_t i = 0; i < size; ++i)
      if (region.contains(at(i))) {
        gone.push_back(static_cast<std::uint32_t>(i));
        mass += mass_of(i);
      }
    count += gone.size();
    return gone;
  }
};

}  // namespace acopla::dem
