// Orders of convergence on smooth contacts, from errors at steps that are halved.
#include <gtest/gtest.h>

#include <cmath>

#include "cases.h"

namespace acopla::dem::verification {
namespace {

double order(const std::function<Outcome(double)>& run, double fraction) {
  return std::log2(run(fraction).worst() / run(fraction / 2).worst());
}

TEST(OrderOfConvergence, IsTwoOnASmoothContactWithAndWithoutADashpot) {
  // 0.02 of critical is 180 steps a period or more: the next term of the error leaves 1e-2 of the exponent.
  for (const double zeta : {0.0, 0.1, 0.5}) {
    EXPECT_NEAR(order([&](double f) { return normal_oscillation(f, zeta); }, 0.02), 2, 0.02) << zeta;
    EXPECT_NEAR(order([&](double f) { return free_vibration(f, zeta); }, 0.02), 2, 0.02) << zeta;
  }
}

TEST(OrderOfConvergence, IsTwoOnTheSpringsOfSlipAndOfRolling) {
  // Half-step velocities follow the motion exactly, so springs that grow by increments are as good as direct ones.
  EXPECT_NEAR(order([](double f) { return tangential_oscillation(f, 0); }, 0.02), 2, 0.02);
  EXPECT_NEAR(order([](double f) { return rolling_oscillation(f, 0); }, 0.02), 2, 0.02);
}

TEST(OrderOfConvergence, IsOneWithTangentialAndRollingDashpots) {
  // These take the rate half a step back. That is by design (it stays stable longer); a scheme that became worse would show here.
  for (const double zeta : {0.1, 0.5}) {
    EXPECT_NEAR(order([&](double f) { return tangential_oscillation(f, zeta); }, 0.01), 1, 0.05) << zeta;
    EXPECT_NEAR(order([&](double f) { return rolling_oscillation(f, zeta); }, 0.01), 1, 0.05) << zeta;
  }
  // Of the size of the period over the step: at the default step (0.2 of critical, 70 steps a period) a hundredth of the amplitude.
  EXPECT_LT(tangential_oscillation(0.2, 0.1).worst(), 2e-3);
  EXPECT_LT(rolling_oscillation(0.2, 0.1).worst(), 1e-2);
}

TEST(OrderOfConvergence, OfHertzsPeaksAndDurationIsTwo) { EXPECT_NEAR(order(hertz_head_on, 0.02), 2, 0.1); }

TEST(OrderOfConvergence, OfARestitutionIsOneForTheWorstPhaseAndTwoForTheMean) {
  const auto errors = [](const char* normal, double fraction, const char* which) { return restitution(fraction, normal, 0.5, false).worst(which); };
  const auto of = [&](const char* normal, const char* which) { return std::log2(errors(normal, 0.08, which) / errors(normal, 0.04, which)); };
  EXPECT_NEAR(of("linear", "restitution"), 1, 0.1);   // the force jumps at touch
  EXPECT_NEAR(of("hertz", "restitution"), 1.25, 0.1);  // it has a root there
  EXPECT_NEAR(of("linear", "mean"), 2, 0.2);
  EXPECT_NEAR(of("hertz", "mean"), 2, 0.2);
}

TEST(FreeVibration, FollowsTheDampedCosine) {
  // Ten periods of second order: the undamped phase error is (h²/24) 2π 10 at h = ω Δt = 0.0071, 1.3e-4.
  EXPECT_LT(free_vibration(0.01, 0).worst(), 1.4e-4);
  EXPECT_LT(free_vibration(0.01, 0.1).worst(), 1e-5);
  EXPECT_LT(free_vibration(0.01, 0.5).worst(), 1.2e-5);
}

}  // namespace
}  // namespace acopla::dem::verification
