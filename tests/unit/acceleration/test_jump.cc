// Motions that jump under iteration.
#include <gtest/gtest.h>

#include <functional>

#include "coupler/acceleration/jump.h"

namespace acopla::coupler::test {
namespace {

using Vector = Eigen::VectorXd;

// r = slope · (solution − x), and from `at` on, along the first axis, `jump` less.
struct Answer {
  double slope, jump, at;
  Vector operator()(const Vector& x) const {
    Vector residual = slope * (Vector::Constant(x.size(), 1.0) - x);
    if (x[0] > at) residual -= jump * Vector::Ones(x.size());
    return residual;
  }
};

// Feeds what relaxation would try, and then what the jump asks for. @return iterations until it is closer than the distance, or never (−1)
int settle(Jump& jump, const Answer& answer, double distance, Vector x) {
  jump.begin_window();
  for (int k = 1; k <= 60; ++k) {
    const Vector residual = answer(x);
    jump.note(x, residual, 1e-14);
    if (jump.closer_than(distance)) return k;
    x = jump.enclosed() ? jump.next() : Vector(x + 0.7 * residual);
  }
  return -1;
}

TEST(AJump, IsEnclosedAndBroughtAsCloseAsIsAsked) {
  Jump jump;
  const Answer answer{1, 0.5, 0.9};  // the residual is 0.1 on one side and −0.4 on the other
  const int wide = settle(jump, answer, 1e-3, Vector::Zero(3)), close = settle(jump, answer, 1e-9, Vector::Zero(3));
  ASSERT_GT(wide, 0);
  ASSERT_GT(close, wide);
  EXPECT_LE(close, wide + 22);  // halved each time
  EXPECT_NEAR(jump.better()[0], 0.9, 1e-9);
  EXPECT_NEAR(answer(jump.better()).norm(), 0.1 * std::sqrt(3), 1e-8);  // the better side
}

// A steep answer is no jump: the residual between two sides falls, down to its root.
TEST(AJump, IsNotSeenWhereAnAnswerIsOnlySteep) {
  Jump jump;
  jump.begin_window();
  const Answer steep{1e6, 0, 0};
  Vector x = Vector::Zero(2);
  for (int k = 0; k < 40; ++k) {
    const Vector residual = steep(x);
    if (residual.norm() < 1e-9) break;
    jump.note(x, residual, 1e-14);
    EXPECT_FALSE(jump.closer_than(1e-8));
    x = jump.enclosed() ? jump.next() : Vector(x + 1e-5 * residual);  // overshoots ten times
  }
  EXPECT_LT(steep(x).norm(), 1e-9);
}

TEST(AJump, IsNotSeenWhereIterationsCreepOrFall) {
  for (const double relaxation : {0.9, 0.01}) {
    Jump jump;
    jump.begin_window();
    Vector x = Vector::Zero(2);
    for (int k = 0; k < 100; ++k) {
      const Vector residual = Answer{1, 0, 0}(x);
      jump.note(x, residual, 1e-14);
      EXPECT_FALSE(jump.enclosed());
      x += relaxation * residual;
    }
  }
}

TEST(AJump, IsForgottenWithItsWindow) {
  Jump jump;
  ASSERT_GT(settle(jump, {1, 0.5, 0.9}, 1e-3, Vector::Zero(1)), 0);
  EXPECT_TRUE(jump.enclosed());
  jump.begin_window();
  EXPECT_FALSE(jump.enclosed());
  EXPECT_FALSE(jump.closer_than(1));
}

}  // namespace
}  // namespace acopla::coupler::test
