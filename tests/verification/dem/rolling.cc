// Sliding, rolling, resting and spinning on a floor against piecewise-smooth ODEs with the engine's own rules (reference.json, README): the
// trajectories themselves, then the rigid limits that Gomes (2014) §3.2.2–3.2.3 compares with.
#include <gtest/gtest.h>

#include <fmt/format.h>

#include <cmath>

#include "cases.h"
#include "dem/step.h"
#include "setup.h"

namespace acopla::dem::verification {
namespace {

void expect_close(const Outcome& outcome, double tolerance) {
  ASSERT_FALSE(outcome.figures.empty());
  for (const auto& figure : outcome.figures) EXPECT_NEAR(figure.value, figure.reference, tolerance * figure.scale) << figure.name;
}

double value_of(const Outcome& outcome, const std::string& name) {
  for (const auto& figure : outcome.figures)
    if (figure.name.rfind(name, 0) == 0) return figure.value;
  return std::nan("");
}

struct Motion {
  std::string key;
  double tolerance;
  friend std::ostream& operator<<(std::ostream& out, const Motion& motion) { return out << motion.key; }
};

class StruckBall : public testing::TestWithParam<Motion> {};

// The dashpot of the friction spring is half a step late: first order, errors at 0.01 of critical of 3 to 4.5e-5 of the speed.
TEST_P(StruckBall, SlipsAndRollsAsTheOde) { expect_close(struck_ball(0.01, GetParam().key), GetParam().tolerance); }
INSTANTIATE_TEST_SUITE_P(Gomes322, StruckBall,
                         testing::Values(Motion{"disc_engine_stiffness_x1", 6e-5}, Motion{"disc_engine_stiffness_x100", 4e-5},
                                         Motion{"sphere_engine_stiffness_x1", 6e-5}, Motion{"sphere_engine_stiffness_x100", 4e-5}));

TEST(StruckBall, RollsInTheEndAtTheSpeedOfItsAngularMomentum) {
  // About the foot nothing turns it, so v and ω in the end do not depend on stiffness or law: 0.94444 m/s and −31.4815 rad/s for the disc,
  // but for the foot's place, an overlap (2.5e-3 of the radius) nearer to the centre: v = (v0 − I ω0/(m a)) / (1 + I/(m a²)).
  for (const std::string shape : {"disc", "sphere"}) {
    const auto& p = reference()["struck_ball"]["parameters"];
    const auto& rigid = reference()["struck_ball"]["values"]["rigid"][shape];
    const double r = p["radius"], arm = r - p["static_overlap"].get<double>(), beta = shape == "disc" ? 0.5 : 0.4;
    const double v0 = p["speed"], w0 = p["spin"], share = beta * r * r / (arm * arm);
    const double exact = (v0 - share * w0 * arm) / (1 + share);
    const auto outcome = struck_ball(0.05, shape + "_engine_stiffness_x100");
    const auto& v = outcome.figures[outcome.figures.size() - 2];
    const auto& surface = outcome.figures.back();
    // Angular momentum is kept to round-off; the last of the springs' swing has died by 0.2 s.
    EXPECT_NEAR(v.value, exact, 1e-11);
    EXPECT_NEAR(surface.value * arm / r, -exact, 1e-11);
    EXPECT_NEAR(v.value, rigid["speed"], 2e-3);
  }
}

class RollingDisc : public testing::TestWithParam<Motion> {};

// Figures 3.9–3.11 and table 3.3. Errors at 0.01 of critical are of first order: dashpots half a step late, and the step in which the
// rolling spring yields, in which its dashpot (outside the cap in the printed law) is many times the limit.
TEST_P(RollingDisc, SlidesRollsAndStopsAsTheOde) { expect_close(rolling(0.01, GetParam().key), GetParam().tolerance); }
INSTANTIATE_TEST_SUITE_P(Gomes323, RollingDisc,
                         testing::Values(Motion{"disc_engine_stiffness_x1", 1.2e-4}, Motion{"disc_engine_stiffness_x100", 1.5e-4},
                                         Motion{"sphere_engine_stiffness_x1", 1.2e-4}, Motion{"sphere_engine_stiffness_x100", 1.2e-4},
                                         Motion{"disc_engine_mu_r_0.05", 1.2e-4}, Motion{"disc_engine_mu_r_0.1", 1.2e-4},
                                         Motion{"disc_engine_mu_r_0.2", 1.2e-4}, Motion{"disc_engine_mu_r_0.4", 1.2e-4},
                                         Motion{"disc_engine_eta_0", 3e-6}, Motion{"disc_engine_eta_0.3", 1.2e-4},
                                         Motion{"disc_engine_k_r_x0.5", 1.2e-4}, Motion{"disc_engine_k_r_x1", 1.2e-4},
                                         Motion{"disc_engine_k_r_x2", 1.2e-4}, Motion{"r_0.05_engine", 4e-4},
                                         Motion{"r_0.05_engine_without_rolling_dashpot", 4e-4}, Motion{"r_0.005_engine", 1.2e-4},
                                         Motion{"r_0.005_engine_without_rolling_dashpot", 4e-6}));

TEST(RollingDisc, DeceleratesAtTwoThirdsOfMuRGAndASphereAtFiveSevenths) {
  for (const std::string shape : {"disc", "sphere"}) {
    const auto outcome = rolling(0.05, shape + "_engine_stiffness_x1");
    const auto v_at = [&](const char* time) { return value_of(outcome, fmt::format("v at {} s", time)); };
    const auto& rigid = reference()["rolling_consistent"]["values"]["rigid"][shape];
    const auto& p = reference()["rolling_consistent"]["parameters"];
    const double r = p["radius"], arm = r - p["static_overlap"].get<double>(), beta = shape == "disc" ? 0.5 : 0.4;
    const double exact = 0.2 * standard_gravity * (r / arm) / (1 + beta * r * r / (arm * arm));
    // Both forces are constant then and leapfrog is exact; the swing of the friction spring since sliding ended at 0.05 s has died to
    // exp(−100 · 0.25).
    EXPECT_NEAR((v_at("0.3") - v_at("0.4")) / 0.1, exact, 1e-9);
    EXPECT_NEAR(exact / rigid["deceleration"].get<double>(), 1, 1.2e-3);  // the foot is an overlap nearer: 2.5e-3 of the radius
  }
}

TEST(RollingDisc, TableAsPrintedPasses28CentimetresAndRollsBack) {
  // Errata: with the printed radius of 0.05 m the couple never reaches its limit; the disc turns at 0.3904 m (0.4032 m if friction acted at
  // the full radius; the printed spring lets the disc sink in by 2.5 % of it).
  const auto outcome = rolling(0.01, "r_0.05_engine");
  EXPECT_NEAR(value_of(outcome, "distance"), 0.3904, 1e-4);
  EXPECT_GT(value_of(outcome, "x at 0.5 s"), 0.28);
  EXPECT_LT(value_of(outcome, "v at 1 s"), 0);
}

class Incline : public testing::TestWithParam<Motion> {};

TEST_P(Incline, CreepsRestsOrRollsAsTheOde) { expect_close(incline(0.01, GetParam().key), GetParam().tolerance); }
// Relative to the distance at 0.5 s, which at 0.5 of the threshold is 5e-5 m of elastic creep. First order, as the dashpots.
INSTANTIATE_TEST_SUITE_P(EverySlope, Incline,
                         testing::Values(Motion{"disc_tan_over_mu_r_0.5", 1e-4}, Motion{"disc_tan_over_mu_r_0.95", 4e-4},
                                         Motion{"disc_tan_over_mu_r_0.999", 4e-4}, Motion{"disc_tan_over_mu_r_1.001", 4e-4},
                                         Motion{"disc_tan_over_mu_r_1.05", 4e-4}, Motion{"disc_tan_over_mu_r_1.5", 4e-4},
                                         Motion{"sphere_tan_over_mu_r_0.5", 1e-4}, Motion{"sphere_tan_over_mu_r_0.95", 4e-4},
                                         Motion{"sphere_tan_over_mu_r_0.999", 4e-4}, Motion{"sphere_tan_over_mu_r_1.001", 4e-4},
                                         Motion{"sphere_tan_over_mu_r_1.05", 4e-4}, Motion{"sphere_tan_over_mu_r_1.5", 4e-4}));

TEST(Incline, RestsExactlyWhileMuRIsAtLeastTheSlope) {
  // Set rolling downhill at 0.02 m/s, 1e-4 below and above the threshold tan θ = μ_r r/a, a the arm of friction: it must slow down, or gain
  // speed, by ±1e-4 of μ_r g cos θ/(1 + β), which leapfrog resolves to round-off because all forces are constant.
  for (const int dimension : {2, 3}) {
    const double r = 0.005, mu_r = 0.2, beta = dimension == 2 ? 0.5 : 0.4;
    for (const double sign : {-1.0, 1.0}) {
      OneMaterial setup;
      setup.dimension = dimension;
      setup.radius = r;
      setup.density = 1056;
      setup.normal = linear(6.5e4);
      setup.tangential = linear_slider(20, 0.3);
      setup.rolling = elastic_plastic(0.3);
      setup.friction = 0.8;
      setup.rolling_friction = mu_r;
      const double m = setup.density * volume_of(dimension, r);
      // θ and the static overlap depend on each other by 1e-3: three rounds are round-off.
      double slope = std::atan(mu_r), overlap = 0;
      for (int round = 0; round < 20; ++round) {
        overlap = m * standard_gravity * std::cos(slope) / 6.5e4;
        slope = std::atan(mu_r * r / (r - overlap) * (1 + sign * 1e-4));
      }
      setup.gravity = standard_gravity * Vec3(std::sin(slope), -std::cos(slope), 0);
      const auto scene = scene_of(setup);
      const double arm = r - overlap, v0 = 0.02;
      const auto engine = engine_of(scene, {{Vec3(0, r - overlap, 0), r, Vec3(v0, 0, 0), Vec3(0, 0, -v0 / arm)}}, {plane(Vec3::Zero(), Vec3::UnitY())});
      const double step = 0.1 * critical_step(scene).seconds;
      engine->advance(static_cast<std::uint64_t>(0.5 / step), step);  // the springs find their places
      const double before = velocity(*engine)[0], time = engine->time();
      engine->advance(static_cast<std::uint64_t>(0.5 / step), step);
      const double found = (velocity(*engine)[0] - before) / (engine->time() - time);
      const double expected = sign * 1e-4 * mu_r * (r / arm) * standard_gravity * std::cos(slope) / (1 + beta * r * r / (arm * arm));
      EXPECT_NEAR(found, expected, 1e-3 * std::abs(expected)) << dimension << "D, " << sign;
    }
  }
}

class SpinDecay : public testing::TestWithParam<Motion> {};

// A ball that twists or rolls on the spot: ω = ω0 − M t/I, exact once the spring has yielded. It yields within 2e-6 s, which is shorter than
// the step: in that one step the dashpot, outside the cap in the printed law, takes c_r ω0 Δt/(2 I) too much, 1.1e-3 of ω0 for rolling.
TEST_P(SpinDecay, IsLinearInTime) { expect_close(spin_decay(0.01, GetParam().key), GetParam().tolerance); }
INSTANTIATE_TEST_SUITE_P(TwistingAndRolling, SpinDecay,
                         testing::Values(Motion{"torsion_printed", 8e-4}, Motion{"rolling_frictionless_floor_printed", 1.5e-3}));

}  // namespace
}  // namespace acopla::dem::verification
