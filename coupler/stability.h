// How far an explicit scheme is from its limits, from what the participants know of the contacts between them.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "coupler/account.h"

namespace acopla::coupler {

/// A contact between a node of a structure and a particle.
struct Touch {
  double stiffness = 0, dashpot = 0;  ///< [N/m], [N s/m]
  double particle = 0, node = 0;      ///< masses [kg]
};

/// Growth of the motion in a window of the serial explicit scheme, |λ| − 1 of the largest eigenvalue of a window (docs/theory.md): the particle, which
/// computes exactly, meets a surface that goes on with its velocity; the node takes the mean of its force by the midpoint rule.
/// @param length  of the window [s]
///
/// A particle that nothing else holds: Δt⁴ k² / (48 M m) undamped and in short windows, negative with dashpots.
double growth_of_free_particle(const Touch& touch, double length);
/// One between the node and a contact of the same kind with something that stands, as in a bed. A light undamped one is thrown about by the steps
/// between windows, however short; a light damped one gives way, so that the node feels half the stiffness, and is stable up to ω_c Δt = √8.
double growth_of_held_particle(const Touch& touch, double length);
/// The larger of the two.
double explicit_growth(const Touch& touch, double length);

/// What holds the nodes of the structures, window by window.
class Stability {
 public:
  /// Of explicit schemes. Nodes count of surfaces whose owners know what a sudden force moves there.
  explicit Stability(const Crew& crew, const Account& account);

  /// Nobody knows masses: nothing can be said.
  bool silent() const { return nodes_.empty(); }
  /// Takes over what the loaders have said of the contacts there are.
  void measure(const std::map<std::string, protocol::Advance>& answers);
  /// A node is held by something.
  bool held() const { return held_; }

  struct Worst {
    double ratio = 0;   ///< root of (k Δt² + 2 c Δt)/M of the worst node, [radians]: unstable from 2 on
    double growth = 0;  ///< explicit_growth of the worst node, and of that with the lightest particles for its stiffness, whichever is larger
    std::string surface;
    std::size_t node = 0;  ///< of the ratio
  };
  /// In windows of this length [s].
  Worst worst(double length) const;
  double mass_at(const Worst& worst) const;  ///< [kg]

 private:
  /// Of the nodes of a structure's surface: masses by direction, and what touches them.
  struct Nodes {
    std::vector<geometry::Vec3> mass;                       // [kg]
    std::vector<geometry::Vec3> stiffness, dashpot, touching;  // [N/m], [N s/m], [kg]: the same in every direction
  };
  const Account& account_;
  std::map<std::string, Nodes> nodes_;
  bool held_ = false;
};

}  // namespace acopla::coupler
