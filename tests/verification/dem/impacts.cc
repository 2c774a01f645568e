// Impacts against closed forms and ODEs (reference.json). Where a force jumps at touch (linear dashpot) or has a root there (Hertz's),
// the error of one impact is of first order, or 5/4, in the step, and depends on where in the step the bodies touch: all cases take the
// worst over phases of the step. What the tolerances are made of is the error constant of each case, seen over a decade of steps and
// rounded up by no more than a half.
#include <gtest/gtest.h>

#include <fmt/format.h>

#include <cmath>

#include "cases.h"
#include "setup.h"

namespace acopla::dem::verification {
namespace {

void expect_close(const Outcome& outcome, double tolerance, const std::string& prefix = "") {
  ASSERT_FALSE(outcome.figures.empty());
  for (const auto& figure : outcome.figures)
    if (figure.name.rfind(prefix, 0) == 0) {
      EXPECT_NEAR(figure.value, figure.reference, tolerance * figure.scale) << figure.name;
    }
}

// Gomes (2014) §3.2.1.
class ElasticCollision : public testing::TestWithParam<std::size_t> {};

TEST_P(ElasticCollision, LeavesAsTheSoftContactMust) {
  // 800 steps an impact or more, and the rebound of an elastic contact is of second order or better.
  expect_close(elastic_collision(0.01, GetParam()), 2e-5);
}

TEST_P(ElasticCollision, KeepsMomentumAndEnergyAndLeavesAtARightAngle) {
  const auto outcome = elastic_collision(0.01, GetParam());
  const auto& p = reference()["elastic_collision"]["parameters"];
  const double m = p["mass"], speed = p["speed"];
  for (std::size_t k = 0; k < outcome.figures.size(); k += 6) {
    // In the order of cases.cc: 1.x, 2.x, 1.y, 2.y, angle 1, angle 2.
    const double x1 = outcome.figures[k].value, x2 = outcome.figures[k + 1].value, y1 = outcome.figures[k + 2].value,
                 y2 = outcome.figures[k + 3].value;
    EXPECT_NEAR(x1 + x2, speed, 1e-14) << "equal masses of " << m << " kg: round-off";
    EXPECT_NEAR(y1 + y2, 0, 1e-14);
    EXPECT_NEAR(x1 * x1 + y1 * y1 + x2 * x2 + y2 * y2, speed * speed, 2e-5);  // as the velocities themselves
    EXPECT_NEAR(outcome.figures[k + 4].value - outcome.figures[k + 5].value, 90, 2e-3);
  }
}
INSTANTIATE_TEST_SUITE_P(EveryStiffness, ElasticCollision, testing::Range<std::size_t>(0, 7));

TEST(ElasticCollision, GivesTheAnglesAndSpeedsOfGomessTable) {
  const auto outcome = elastic_collision(0.01, 1);  // 4.9e4 N/m
  const auto& printed = reference()["elastic_collision"]["parameters"]["printed_in_the_paper"];
  // Two decimals are printed.
  EXPECT_NEAR(outcome.figures[4].value, printed["angle_1_degrees"], 0.005);
  EXPECT_NEAR(outcome.figures[5].value, printed["angle_2_degrees"], 0.005);
  for (int d = 0; d < 2; ++d) {
    EXPECT_NEAR(outcome.figures[static_cast<std::size_t>(2 * d)].value, printed["speed_1"][static_cast<std::size_t>(d)], 0.005);
    EXPECT_NEAR(outcome.figures[static_cast<std::size_t>(2 * d + 1)].value, printed["speed_2"][static_cast<std::size_t>(d)], 0.005);
  }
}

TEST(ElasticCollision, TendsToTheRigidAngleAsTheRootOfTheStiffness) {
  const double rigid = reference()["elastic_collision"]["values"]["rigid"]["angle_1_degrees"];
  const auto away = [&](std::size_t soft) { return std::abs(elastic_collision(0.001, soft).figures[4].value - rigid); };
  // Stiffness times 100 between 4.9e6 and 4.9e8: exponent 0.50045 by the reference.
  EXPECT_NEAR(std::log10(away(3) / away(5)) / 2, 0.5, 2e-3);
  EXPECT_LT(away(6), 2e-3);
}

TEST(HertzHeadOn, PeakOverlapForceAndDurationAreHertzsForUnequalSpheres) {
  // Two sizes, two materials; second order, 480 steps an impact.
  expect_close(hertz_head_on(0.01), 1e-5);
}

struct Bounce {
  std::string normal;
  double e;
  bool paper;
  friend std::ostream& operator<<(std::ostream& out, const Bounce& b) { return out << b.normal << " e " << b.e << (b.paper ? " paper" : ""); }
};

class Restitution : public testing::TestWithParam<Bounce> {};

TEST_P(Restitution, IsTheInputOrWhatThePrintedFormulaReallyGives) {
  const auto [normal, e, paper] = GetParam();
  const auto outcome = restitution(0.01, normal, e, paper);
  if (e == 1) {
    expect_close(outcome, 1e-5);  // elastic: second order or better
    return;
  }
  // Worst phase: of first order for the linear dashpot, 5/4 for Hertz's. The mean over phases is of second order.
  expect_close(outcome, normal == "linear" ? 7e-4 : 4e-4, "restitution");
  expect_close(outcome, 3e-5, "mean restitution");
  expect_close(outcome, 1e-3, "peak overlap");
}

std::vector<Bounce> every_restitution() {
  std::vector<Bounce> all;
  for (const char* normal : {"linear", "hertz"})
    for (const bool paper : {false, true})
      for (const double e : {0.01, 0.1, 0.3, 0.5, 0.8, 0.9, 1.0})
        if (!(paper && e == 1.0)) all.push_back({normal, e, paper});
  return all;
}
INSTANTIATE_TEST_SUITE_P(EveryLaw, Restitution, testing::ValuesIn(every_restitution()));

struct Oblique {
  double e, tangential, tolerance;
  friend std::ostream& operator<<(std::ostream& out, const Oblique& o) { return out << "e " << o.e << " tangential " << o.tangential; }
};

class ObliqueImpact : public testing::TestWithParam<Oblique> {};

TEST_P(ObliqueImpact, LeavesWithTheSpeedAndSpinOfCoulombsLaw) {
  const auto [e, tangential, tolerance] = GetParam();
  expect_close(oblique_impact(0.01, e, tangential), tolerance);
}

// Gross sliding has no switch and no dashpot: second order. The others change between sticking and sliding within a step, or have a force
// that jumps at touch: first order, worst of eight phases.
INSTANTIATE_TEST_SUITE_P(SlidingAndSticking, ObliqueImpact,
                         testing::Values(Oblique{1, 8, 7e-6}, Oblique{1, 1, 2e-3}, Oblique{1, 0.2, 5e-4}, Oblique{0.5, 8, 1.5e-3},
                                         Oblique{0.5, 1, 8e-4}, Oblique{0.5, 0.2, 5e-4}));

TEST(ObliqueImpact, GrossSlidingIsCoulombsImpulse) {
  // Tangential impulse = μ times the normal impulse, to the order of the elastic rebound.
  const auto& closed = reference()["oblique_impact"]["values"]["gross_sliding"]["e_1"];
  const auto outcome = oblique_impact(0.01, 1, 8);
  const double tangential = closed["tangential_speed"];
  for (std::size_t k = 0; k < outcome.figures.size(); k += 3) {
    EXPECT_NEAR(outcome.figures[k + 1].value, tangential, 7e-6);
    EXPECT_NEAR((8 - outcome.figures[k + 1].value) / (1 + outcome.figures[k].value), 0.3, 1e-13);  // step by step, to round-off
  }
}

struct Fall {
  std::string law;
  double e, tolerance;
  friend std::ostream& operator<<(std::ostream& out, const Fall& fall) { return out << fall.law << " e " << fall.e; }
};

class BouncingBall : public testing::TestWithParam<Fall> {};

TEST_P(BouncingBall, RisesToTheHeightsOfTheOde) {
  const auto [law, e, tolerance] = GetParam();
  expect_close(bouncing_ball(0.01, law, e), tolerance);
}

// Apex heights and instants, peak overlaps of up to four bounces. The phase at touch is whatever it is: worst-phase errors of an impact
// (first order, second without a dashpot) that add up over the bounces.
INSTANTIATE_TEST_SUITE_P(EveryLaw, BouncingBall,
                         testing::Values(Fall{"linear_1e+04", 1, 5e-5}, Fall{"linear_1e+04", 0.8, 1e-3}, Fall{"linear_1e+04", 0.5, 1e-3},
                                         Fall{"linear_1e+04", 0.3, 1e-3}, Fall{"linear_1e+06", 1, 5e-5}, Fall{"linear_1e+06", 0.8, 1e-3},
                                         Fall{"linear_1e+06", 0.5, 1.5e-3}, Fall{"linear_1e+06", 0.3, 3e-3}, Fall{"hertz_1.33e+06", 1, 1e-5},
                                         Fall{"hertz_1.33e+06", 0.8, 3e-4}, Fall{"hertz_1.33e+06", 0.5, 1e-3}, Fall{"hertz_1.33e+06", 0.3, 1e-3},
                                         Fall{"hertz_1.33e+08", 1, 1e-5}, Fall{"hertz_1.33e+08", 0.8, 3e-4}, Fall{"hertz_1.33e+08", 0.5, 1e-3},
                                         Fall{"hertz_1.33e+08", 0.3, 1e-3}));

}  // namespace
}  // namespace acopla::dem::verification
