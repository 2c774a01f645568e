// The stable step: the closed form of one contact, growth on either side of it, and what is watched and refused.
#include <gtest/gtest.h>

#include "dem/laws.h"
#include "dem/step_watch.h"
#include "scenes.h"

namespace acopla::dem::test {
namespace {

constexpr double stiffness = 1e4;

Laws spring(double restitution) { return {"{ law = \"linear\", stiffness = 1e4 }", "none", "none", restitution, 0, 0}; }

// ζ of the no-tension contact with that restitution is the laws' own business; the kernel says what dashpot came out.
double damping_ratio(const Scene& scene) {
  const auto rates = scene.laws->make(scene.pair(0, 0), 3)->stiffness(1e-4, radius, mass, 0);
  return rates.normal_dashpot / (2 * std::sqrt(stiffness * mass));
}

// Leapfrog with the closing speed extrapolated to the whole step: h² + 8 ζ h ≤ 4 with h = ω Δt (dem/stability.h).
double limit(double zeta) { return 2 * std::sqrt(mass / stiffness) * (std::sqrt(1 + 4 * zeta * zeta) - 2 * zeta); }

std::unique_ptr<Engine> resting_ball(Laws laws, double speed, bool allow = true) {
  auto scene = scene_of(laws);
  scene.gravity = Vec3(0, 0, -stiffness * 0.01 * radius / mass);  // an overlap of 1 % of the radius
  scene.allow_unstable_step = allow;
  return engine_with(scene, {{Vec3(0, 0, 0.99 * radius), Vec3(0, 0, speed)}}, {plane(Vec3::Zero(), Vec3::UnitZ())});
}

class OneContact : public testing::TestWithParam<double> {};

TEST_P(OneContact, StepRatioIsTheClosedForm) {
  const auto laws = spring(GetParam());
  const auto engine = resting_ball(laws, 0);
  const double zeta = damping_ratio(scene_of(laws));
  engine->advance(1, 1e-6 * limit(zeta));
  EXPECT_NEAR(engine->step_ratio(limit(zeta)).value, 1, 1e-12);
  EXPECT_NEAR(engine->step_ratio(0.3 * limit(0)).value, GetParam() == 1 ? 0.3 : 0.3 * limit(0) / limit(zeta), 1e-12);
}

TEST_P(OneContact, ADisturbanceGrowsBeyondTheLimitAndNotBelow) {
  const auto laws = spring(GetParam());
  const double zeta = damping_ratio(scene_of(laws));
  for (const double share : {0.99, 1.01}) {
    const double speed = 1e-9;  // so small that the ball keeps touching while it grows a thousandfold
    const auto engine = resting_ball(laws, speed);
    const double start = engine->kinetic_energy();
    double most = 0;
    for (int step = 0; step < 5000 && most < 1e6; ++step) {
      engine->advance(1, share * limit(zeta));
      most = std::max(most, engine->kinetic_energy() / start);
    }
    // Undamped just below the limit the speed of the whole step exceeds the true one by 1/sqrt(1 − h²/4), 7 at 0.99.
    if (share < 1) EXPECT_LT(most, 60) << share;
    else EXPECT_GE(most, 1e6) << share;
  }
}

INSTANTIATE_TEST_SUITE_P(Restitutions, OneContact, testing::Values(1.0, 0.5, 0.05), [](const auto& given) {
  return "e_" + std::to_string(static_cast<int>(100 * given.param));
});

TEST(StepWatch, StopsWhoStaysBeyondTheLimitAndNotWhoPasses) {
  const auto scene = scene_of(spring(1));
  const auto engine = resting_ball(spring(1), 0);
  engine->advance(1, 1e-6);
  StepWatch watch(scene);
  const double long_step = 1.2 * limit(0);
  watch.look(*engine, long_step, 1);
  EXPECT_NEAR(watch.ratio(), 1.2, 1e-12);
  watch.look(*engine, 0.5 * limit(0), 201);
  watch.look(*engine, long_step, 401);
  EXPECT_LT(watch.ratio(), 1) << "the second look was good: the next is after 400 steps";
  watch.look(*engine, long_step, 601);
  watch.look(*engine, long_step, 800);  // too soon: not looked at
  try {
    watch.look(*engine, long_step, 801);
    FAIL() << "nothing was said";
  } catch (const std::runtime_error& error) {
    const std::string said = error.what();
    for (const auto* part : {"is unstable at t = 1e-06 s", "1.20 of the limit", "particle 0 at (0, 0, 0.0099) m", "Lower step_fraction"})
      EXPECT_NE(said.find(part), std::string::npos) << said;
  }
}

TEST(StepWatch, ALongStepKeepsTheLedgerUnlessAllowed) {
  auto scene = scene_of(hertz_mindlin);
  const double critical = critical_step(scene).seconds;
  EXPECT_FALSE(watches_energy(scene, 0.2 * critical));
  EXPECT_FALSE(watches_energy(scene, 0.499 * critical));
  EXPECT_TRUE(watches_energy(scene, 0.5 * critical));
  scene.allow_unstable_step = true;
  EXPECT_FALSE(watches_energy(scene, 0.9 * critical));
}

TEST(FirstOverlaps, DeeperThanHalfARadiusIsRefused) {
  const auto pair = [](double overlap, bool allow) {
    auto scene = scene_of(hertz_mindlin);
    scene.allow_unstable_step = allow;
    return engine_with(scene, {{Vec3::Zero()}, {Vec3(0, 0, (2 - overlap) * radius)}});
  };
  EXPECT_NO_THROW(pair(0.49, false)->advance(1, 1e-7));
  EXPECT_NO_THROW(pair(0.6, true)->advance(1, 1e-7));
  try {
    pair(0.6, false)->advance(1, 1e-7);
    FAIL() << "nothing was said";
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("begin with an overlap of 0.6 of the smaller one's radius"), std::string::npos) << error.what();
  }
}

TEST(Engine, NoStepsChangeNothing) {
  const auto engine = resting_ball(spring(0.5), 0.1);
  engine->advance(7, 1e-5);
  const Vec3 at = position(*engine), moving = velocity(*engine);
  engine->advance(0, 1e-5);
  EXPECT_EQ(position(*engine), at);
  EXPECT_EQ(velocity(*engine), moving);
}

TEST(EnergyLedger, FrictionThatGivesEnergyIsDrift) {
  EnergyLedger ledger;
  ledger.balance(10, 0);
  ContactEnergy<double> friction;
  friction.tangential_work = -1;  // one joule given to the bodies, which indeed move faster
  ledger.step(friction, 0, 0, 1e-3);
  const auto balance = ledger.balance(11, 0);
  EXPECT_DOUBLE_EQ(balance.drift, 0);
  EXPECT_DOUBLE_EQ(balance.made, 1);
  EXPECT_DOUBLE_EQ(balance.relative_drift, 1.0 / 11);
}

}  // namespace
}  // namespace acopla::dem::test
