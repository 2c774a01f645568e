// How long a step may be, measured on the contacts there are.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "dem/kernel.h"

namespace acopla::dem {

struct StepRatio {
  double value = 0;            ///< Δt over a bound of its stability limit; 0 without contacts
  std::size_t particle = 0;    ///< the worst one's index
};

/// Bounds the stability limit of a bed by its particles, one by one.
///
/// For leapfrog with springs that follow the motion exactly, normal dashpots at the extrapolated rate and the others at the rate of the
/// half step, a mode with stiffness κ, mass 1 and dashpots γ_n, γ_t is stable while Δt² κ + 2 Δt (2 γ_n + γ_t) ≤ 4 (the characteristic
/// polynomials at z = −1; for the lagged dashpot alone this is (2/ω)(sqrt(1 + ζ²) − ζ)). For the whole bed the largest eigenvalue of
/// M⁻¹(Δt² K + 2 Δt (2 C_n + C_t)) decides. It is at most the largest over the particles of that of their own blocks, translation and
/// rotation together, with pairs counted twice and walls once: (x + y)² ≤ 2 x² + 2 y² for the two bodies of each contact.
class StabilityEstimate {
 public:
  StabilityEstimate(const Particles& particles, double step);
  void add_pair(std::uint32_t i, std::uint32_t j, double overlap, const Kernel& kernel);
  void add_wall(std::uint32_t i, double overlap, const Vec3& normal, double curvature, const Kernel& kernel);
  StepRatio worst() const;

 private:
  using Block = Eigen::Matrix<double, 6, 6>;
  struct Sums {
    Block stiffness = Block::Zero(), dashpot = Block::Zero();  // Δt² K and 2 Δt (2 C_n + C_t), over mass and inertia
  };
  void add(std::uint32_t i, const Vec3& normal, double arm, const ContactStiffness& contact, double bodies);
  const Particles& particles_;
  double step_;
  std::vector<std::uint32_t> place_;  // in sums_, of a particle with contacts
  std::vector<Sums> sums_;
  std::vector<std::uint32_t> particle_;
};

}  // namespace acopla::dem
