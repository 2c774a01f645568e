// The moving part of the particles: neighbours, contacts and time stepping behind one virtual call a window.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "dem/scene.h"

namespace acopla::dem {

/// What the walls received, as the mean over a window: Σ F Δt / window by the trapezoidal rule, which is exactly the
/// momentum that the particles lost to them.
struct WallLoad {
  std::vector<Vec3> vertex_force;    ///< on every vertex of every mesh wall [N]; force and moment of the contacts are exact
  std::vector<Vec3> wall_force;      ///< per wall [N]
  std::size_t couples_lost = 0;      ///< triangles too thin to carry the rolling couple they received
};

struct EngineCosts {
  std::size_t bytes_per_particle = 0, bytes_per_contact = 0;
};

class Engine {
 public:
  virtual ~Engine() = default;

  /// Advances by `steps` steps of Δt. @throws std::runtime_error when a particle leaves the domain, moves too far in a
  /// step or is pushed through a wall; the message names it
  virtual void advance(std::uint64_t steps, double step) = 0;
  /// The walls' load over the last advance().
  virtual const WallLoad& wall_load() const = 0;
  virtual const Particles& particles() const = 0;
  virtual Particles& particles() = 0;

  /// Contacts at the last step, particle–particle and particle–wall.
  virtual std::size_t contact_count() const = 0;
  /// Δt over the limit (2/ω)(sqrt(1+ζ²) − ζ) of the worst particle, ω and ζ summed over the contacts it has now.
  virtual double step_ratio(double step) const = 0;
  /// Deepest overlap over the smaller radius.
  virtual double worst_overlap() const = 0;
  virtual std::uint64_t rebuilds() const = 0;
  virtual std::size_t listed_pairs() const = 0;
  virtual EngineCosts costs() const = 0;

  /// Σ m v²/2 + I ω²/2 [J]
  double kinetic_energy() const;
  /// Σ m [kg]
  double mass() const;
  /// Σ m v [kg m/s]
  Vec3 momentum() const;
};

/// The engine for a scene's set of laws: one instantiation a set (dem/kernels/), chosen here and nowhere else.
std::unique_ptr<Engine> make_engine(const Scene& scene, Particles particles);
/// The same with walls already prepared.
std::unique_ptr<Engine> make_engine(const Scene& scene, Particles particles, WallSet walls);

/// True where the laws of a scene turn its particles.
bool rotates(const LawSet& laws);

}  // namespace acopla::dem
