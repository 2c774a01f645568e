// How long a step may be, measured on the contacts there are.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "dem/kernel.h"

namespace acopla::dem {

struct StepRatio {
  double value = 0;            ///< Δt over the limit; 0 without contacts
  std::size_t particle = 0;    ///< the worst one's index
};

/// Bounds the stability limit of a bed by its particles, one by one. For the undamped bed λ_max(M⁻¹K) ≤ max_i λ_i with
///   λ_i = 2/m_i · λ_max(Σ k_n n nᵀ + (1 + m_i a²/I_i) k_t (1 − n nᵀ)) + 2/I_i Σ k_r
/// over the contacts of particle i (a = r, the arm; 1 in place of the leading 2 for a wall, which does not move): each contact's
/// energy is split between its two bodies by (x + y)² ≤ 2 x² + 2 y², and the tangential one between translation and rotation in the
/// proportion that weighs both alike. The dashpots are summed alike, c_i = λ_max of the same matrices of c; with ω² = λ_i and
/// ζ = c_i / (2 m_i ω) the limit is (2/ω)(sqrt(1 + ζ²) − ζ).
class StabilityEstimate {
 public:
  explicit StabilityEstimate(const Particles& particles);
  void add_pair(std::uint32_t i, std::uint32_t j, double overlap, const Kernel& kernel);
  void add_wall(std::uint32_t i, double overlap, const Vec3& normal, double curvature, const Kernel& kernel);
  StepRatio worst(double step) const;

 private:
  void add(std::uint32_t i, const Vec3& normal, const ContactStiffness& contact, double bodies);
  struct Sums {
    Eigen::Matrix3d stiffness = Eigen::Matrix3d::Zero(), dashpot = Eigen::Matrix3d::Zero();
    double rolling = 0, rolling_dashpot = 0;
    bool touched = false;
  };
  const Particles& particles_;
  std::vector<Sums> sums_;
};

}  // namespace acopla::dem
