// How long a step may be, measured on the contacts there are.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "dem/kernel.h"

namespace acopla::dem {

struct StepRatio {
  double value = 0;            ///< Δt over the stability limit, or over a bound of it; 0 without contacts
  std::size_t particle = 0;    ///< the index of the one that moves most in the stiffest mode
};

/// Bounds the stability limit of a bed by its particles, one by one.
///
/// For leapfrog with springs that follow the motion exactly, normal dashpots at the extrapolated rate and the others at the rate of the
/// half step, a mode with stiffness κ, mass 1 and dashpots γ_n, γ_t is stable while Δt² κ + 2 Δt (2 γ_n + γ_t) ≤ 4 (the characteristic
/// polynomials at z = −1; for the lagged dashpot alone this is (2/ω)(sqrt(1 + ζ²) − ζ)). For the whole bed the largest eigenvalue of
/// M⁻¹(Δt² K + 2 Δt (2 C_n + C_t)) decides. A rolling torque that takes a share of the relative spin in a step is a dashpot c_t = share I*/Δt.
/// The eigenvalue is at most the largest over the particles of that of their own blocks, translation and
/// rotation together, with pairs counted twice and walls once: (x + y)² ≤ 2 x² + 2 y² for the two bodies of each contact.
class StabilityEstimate {
 public:
  StabilityEstimate(const Particles& particles, double step);
  void add_pair(std::uint32_t i, std::uint32_t j, double overlap, const Kernel& kernel);
  void add_wall(std::uint32_t i, double overlap, const Vec3& normal, double curvature, const Kernel& kernel);
  /// The safe bound. It is careful by up to a factor of two or three in dense beds.
  StepRatio bound() const;
  /// The bed's own limit, by conjugate iteration from the bound's mode: to a thousandth or so, and dearer than the bound.
  StepRatio limit() const;
  /// The bound while that says that the step is stable, else the limit.
  StepRatio ratio() const {
    const auto safe = bound();
    return safe.value <= 1 ? safe : limit();
  }

 private:
  // What a contact adds to Δt² K and to 2 Δt (2 C_n + C_t), and of the latter what does not depend on Δt.
  struct Rates {
    double stiffness = 0, dashpot = 0, fixed = 0;
    double at(const Rates& weights) const { return stiffness * weights.stiffness + dashpot * weights.dashpot + fixed * weights.fixed; }
  };
  struct Contact {
    std::uint32_t i, j;  // j: none at a wall
    Vec3 normal;
    double arm_i, arm_j;
    Rates closing, shear, rolling, twisting;
  };
  static constexpr std::uint32_t none = ~0u;
  using Motion = Eigen::Matrix<double, 6, Eigen::Dynamic>;  // velocity and spin of every particle, times the roots of mass and inertia
  using Block = Eigen::Matrix<double, 6, 6>;
  struct Sums {
    Block stiffness = Block::Zero(), dashpot = Block::Zero(), fixed = Block::Zero();
    Block all() const { return stiffness + dashpot + fixed; }
  };
  void add(Contact contact, const ContactStiffness& rates, double reduced_inertia);
  void add_to(Sums& sums, std::uint32_t i, const Contact& contact) const;
  void apply(const Motion& motion, Motion& result, const Rates& weights) const;
  const Particles& particles_;
  double step_;
  std::vector<double> crude_;  // of every particle, a bound of its largest eigenvalue
  std::vector<Contact> contacts_;
  struct Roots {
    double mass, inertia;
  };
  mutable std::vector<Roots> roots_;  // filled when first needed
};

}  // namespace acopla::dem
