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

/// S(C) [Pa] of the laws below, C = Fᵀ F.
template <int d>
Eigen::Matrix<double, d, d> stress_of(const Material& material, double lambda, const Eigen::Matrix<double, d, d>& C) {
  using Square = Eigen::Matrix<double, d, d>;
  const double mu = material.mu();
  if (material.law == Material::Law::neo_hooke)
    return mu * Square::Identity() + (0.5 * lambda * std::log(C.determinant()) - mu) * C.inverse();
  const Square E = 0.5 * (C - Square::Identity());
  return lambda * E.trace() * Square::Identity() + 2 * mu * E;
}

/// Strain energy W(C) [J/m³] of the undeformed body, S = 2 ∂W/∂C: ½ λ tr(E)² + μ E:E of St. Venant–Kirchhoff,
/// ½ μ (tr C − d − ln det C) + ⅛ λ (ln det C)² of neo-Hooke.
template <int d>
double energy_of(const Material& material, double lambda, const Eigen::Matrix<double, d, d>& C) {
  using Square = Eigen::Matrix<double, d, d>;
  const double mu = material.mu();
  const Square E = 0.5 * (C - Square::Identity());
  if (material.law == Material::Law::neo_hooke) {
    const double logarithm = std::log(C.determinant());
    return 0.5 * mu * (2 * E.trace() - logarithm) + 0.125 * lambda * logarithm * logarithm;
  }
  return 0.5 * lambda * E.trace() * E.trace() + mu * E.squaredNorm();
}

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
  return {stress_of<d>(material, lambda, F.transpose() * F), F, mu * F * F.transpose(), lambda, mu, false};
}

}  // namespace acopla::fem
