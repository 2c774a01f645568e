// The verification cases whose references are closed forms or ODEs: each runs the engine at a fraction of the critical step and hands
// back what came out beside reference.json. The tests assert on them; the study dem_accuracy sweeps the fraction.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace acopla::dem::verification {

/// One number beside its reference.
struct Figure {
  std::string name;
  double value = 0, reference = 0;
  double scale = 1;  ///< the error's unit: |reference| for relative errors, or the size of the motion
  double error() const;
};

struct Outcome {
  double step = 0;           ///< [s]
  std::uint64_t steps = 0;
  double seconds = 0;        ///< of computing
  std::vector<Figure> figures;
  /// Largest error of the figures whose name begins with `prefix`.
  double worst(const std::string& prefix = "") const;
};

/// Two frictionless discs; eight phases of the step at touch. @param soft  index of the stiffness in reference.json
Outcome elastic_collision(double fraction, std::size_t soft);
/// @param key  of struck_ball.soft: "disc_engine_stiffness_x100"
Outcome struck_ball(double fraction, const std::string& key);
/// @param key  of rolling_consistent.soft or rolling_printed
Outcome rolling(double fraction, const std::string& key);
/// Of the same, at `count` equal times up to `end` [s].
struct RollingState {
  double time, x, v, spin, couple;  ///< [s], [m], [m/s], [rad/s], [N m]; the couple is the rolling law's
};
std::vector<RollingState> rolling_trace(double fraction, const std::string& key, double end, int count);
/// @param key  of incline
Outcome incline(double fraction, const std::string& key);
Outcome free_vibration(double fraction, double zeta);
/// @param law  "linear_1e+04", "hertz_1.33e+06", …
Outcome bouncing_ball(double fraction, const std::string& law, double restitution);
Outcome hertz_head_on(double fraction);
/// Head-on against a plane, at sixteen phases of the step; figures "restitution …", "mean restitution", "peak overlap", "duration".
/// @param paper  the papers' printed formula, with what it really gives as the reference
Outcome restitution(double fraction, const std::string& normal, double e, bool paper);
/// @param tangential  speed along the wall for a normal speed of 1 m/s: 8, 1 or 0.2
Outcome oblique_impact(double fraction, double e, double tangential);
/// @param key  "torsion_printed" or "rolling_frictionless_floor_printed"
Outcome spin_decay(double fraction, const std::string& key);

/// A column put together touching comes to rest on a floor. @param key  "column_ratio_100_hertz"; @param radii  lowest first [m]
Outcome column(double fraction, const std::string& key, const std::vector<double>& radii);
/// Three in a row squeezed between walls. @param key  "row_ratio_10"; @param law  "linear" or "hertz"
Outcome squeezed_row(double fraction, const std::string& key, const std::string& law);

/// For the order of convergence on contacts that stay closed: position or angle against a closed form.
Outcome normal_oscillation(double fraction, double zeta);
Outcome tangential_oscillation(double fraction, double zeta);
Outcome rolling_oscillation(double fraction, double zeta);

struct Case {
  std::string name, law;
  double order;  ///< expected, of the worst figure in the step; 0: no power law is claimed
  std::function<Outcome(double fraction)> run;
};
/// What the study sweeps.
std::vector<Case> cases();

}  // namespace acopla::dem::verification
