// From a coefficient of restitution to the dashpot that produces it.
#pragma once

namespace acopla::dem {

/// Exponents of a dissipative normal contact F = max(0, δ^p + α δ^q δ̇) in units of mass, stiffness and impact speed:
/// Hertz p = 3/2, q = 1/4 (then e does not depend on the speed); linear p = 1, q = 0.
struct ImpactShape {
  double elastic, viscous;
};
inline constexpr ImpactShape hertz_impact{1.5, 0.25};
inline constexpr ImpactShape linear_impact{1, 0};

/// Restitution of a head-on impact whose contact never pulls: it ends when the force has fallen to zero (Schwager &
/// Pöschel 2007; Thornton, Cummins & Cleary 2013).
/// @param alpha  dashpot in units of the impact, ≥ 0
double restitution_without_tension(const ImpactShape& shape, double alpha);

/// The α that gives restitution e in (0, 1], to 1e-10. The printed formulas (Nasato 2011 eq. 6, 13; Gomes 2014 eq. 2.95)
/// hold where the dashpot may pull and return 0.397 for e = 0.3 without.
double dashpot_for(const ImpactShape& shape, double restitution);

/// −ln e / sqrt(ln² e + π²): the damping ratio of the printed formulas.
double printed_damping_ratio(double restitution);

/// Restitution that the program's own integrator gives in a head-on impact at a step of `fraction` of the impact's
/// half-period, started at a random phase; the mean over phases. For the error printed by explain.
double integrated_restitution(const ImpactShape& shape, double alpha, double step);

/// Duration of the undamped impact in its own units (3.2181 for Hertz, π for linear).
double impact_duration(const ImpactShape& shape);

}  // namespace acopla::dem
