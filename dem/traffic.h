// Particles that come and go while a run goes on: the inlets and outlets of a scene at work. A scene without them has none of this.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "dem/engine.h"

namespace acopla::dem {

class Traffic {
 public:
  explicit Traffic(const Scene& scene);

  bool none() const { return feeds_.empty() && outlets_.empty(); }
  /// How many steps may pass between two visits: about the time in which an inlet owes one particle, at least twenty steps; outlets are
  /// looked through every hundred.
  std::uint64_t steps_between(double step) const;
  /// Takes out what has reached an outlet and puts in what is due at the engine's time.
  void visit(Engine& engine);
  /// INLET.mass and .backlog, OUTLET.mass and .count since the start [kg]
  void quantities(std::vector<std::pair<std::string, double>>& values) const;
  /// Of inlets that found no room, one sentence each.
  std::vector<std::string> warnings() const;

  template <class Archive>
  void state(Archive& archive) {
    for (std::size_t k = 0; k < feeds_.size(); ++k) {
      auto remembered = feeds_[k].state();
      archive("inlet" + std::to_string(k), remembered);
      if constexpr (Archive::reading) feeds_[k].restore(remembered);
    }
    for (std::size_t k = 0; k < outlets_.size(); ++k) {
      archive("outlet" + std::to_string(k) + ".mass", outlets_[k].mass);
      archive("outlet" + std::to_string(k) + ".count", outlets_[k].count);
    }
  }

 private:
  std::vector<InletFeed> feeds_;
  std::vector<Outlet> outlets_;
};

}  // namespace acopla::dem
