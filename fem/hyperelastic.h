// Laws of solids under large strains.
#pragma once

#include <Eigen/LU>
#include <cmath>

#include "fem/material.h"

namespace acopla::fem {

/// Stress of a deformed point, and what its derivative needs.
template <int d>
struct Hyperelastic {
  using Square = Eigen::Matrix<double, d, d>;
  Square S;          ///< second Piola–Kirchhoff stress [Pa]
  Square push;       ///< p_a = push ∇N_a: F of St. Venant–Kirchhoff, F⁻ᵀ of neo-Hooke
  Square G;          ///< of the block ∇N_a·S ∇N_b I + λ p_a ⊗ p_b + m p_b ⊗ p_a + s_ab G [Pa]
  double lambda, m;  ///< [Pa]
  bool spatial;      ///< s_ab is p_a · p_b, otherwise ∇N_a · ∇N_b
};

/// St. Venant–Kirchhoff: S = λ tr(E) I + 2 μ E, E = ½ (Fᵀ F − I), which softens in compression. Compressible neo-Hooke:
/// S = μ (I − C⁻¹) + λ ln J C⁻¹, which stiffens without bound as J → 0 (Bonet & Wood 2008, eq. 6.28 and 6.30).
/// In the plane F is that of plane strain, or λ that of plane stress. Where J ≤ 0 neo-Hooke's stress is not a number.
template <int d>
Hyperelastic<d> respond(const Material& material, double lambda, const Eigen::Matrix<double, d, d>& F) {
  using Square = Eigen::Matrix<double, d, d>;
  const double mu = material.mu();
  if (material.law == Material::Law::neo_hooke) {
    const double logarithm = std::log(F.determinant());
    const Square inverse = F.inverse(), C_inverse = inverse * inverse.transpose();
    const double m = mu - lambda * logarithm;
    return {mu * Square::Identity() - m * C_inverse, inverse.transpose(), m * Square::Identity(), lambda, m, true};
  }
  const Square E = 0.5 * (F.transpose() * F - Square::Identity());
  return {lambda * E.trace() * Square::Identity() + 2 * mu * E, F, mu * F * F.transpose(), lambda, mu, false};
}

}  // namespace acopla::fem
