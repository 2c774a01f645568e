#include <gtest/gtest.h>

#include <cmath>

#include "coupler/mapping/balance.h"
#include "meshes.h"

namespace acopla::coupler {
namespace {

using namespace testing;

TEST(Resultant, OfACoupleIsItsMoment) {
  const std::vector<Vec3> points{{0, 0, 0}, {2, 0, 0}}, forces{{0, -3, 0}, {0, 3, 0}};
  for (const auto& about :
       {Vec3(0, 0, 0), Vec3(5, -1, 2)}) {  // a couple has the same moment about every point
    const auto sum = resultant(points, forces, about);
    EXPECT_EQ(sum.force, Vec3::Zero());
    EXPECT_LT((sum.moment - Vec3(0, 0, 6)).norm(), 1e-14);
    EXPECT_EQ(sum.size, 6);
  }
  EXPECT_DOUBLE_EQ(resultant(points, forces, {1, 0, 0}).turning_size, 6);
}

TEST(Resultant, DoesNotLoseSmallForcesAmongManyLargeOnes) {
  // 1e5 pairs of opposite forces of 1e6 N and one of 1e-6 N: plain summation may keep nothing of
  // it; compensated summation keeps it to a few units of 1e-16 of what it is.
  std::vector<Vec3> points, forces;
  for (int k = 0; k < 100000; ++k) {
    const Vec3 force(1e6 * std::sin(k), 1e6 * std::cos(3 * k), 1e6);
    points.emplace_back(1, 0, 0);
    forces.push_back(force);
  }
  for (int k = 0; k < 100000; ++k) {
    points.emplace_back(1, 0, 0);
    forces.push_back(-forces[static_cast<std::size_t>(k)]);
  }
  points.emplace_back(1, 0, 0);
  forces.emplace_back(1e-6, 0, 0);
  const auto sum = resultant(points, forces, Vec3::Zero());
  EXPECT_LT((sum.force - Vec3(1e-6, 0, 0)).norm(), 1e-15 * 1e-6 + 1e-30 * sum.size);
  EXPECT_LT(sum.moment.norm(), 1e-16 * sum.turning_size);
}

TEST(Loss, IsMeasuredAgainstWhatWasSent) {
  Resultant sent, received;
  sent.force = {10, 0, 0};
  sent.size = 20;
  sent.moment = {0, 1, 0};
  sent.turning_size = 4;
  received = sent;
  EXPECT_EQ(loss(sent, received).force, 0);
  EXPECT_EQ(loss(sent, received).moment, 0);
  received.force.x() = 9;
  received.moment.y() = 3;
  EXPECT_DOUBLE_EQ(loss(sent, received).force, 0.05);
  EXPECT_DOUBLE_EQ(loss(sent, received).moment, 0.5);
  EXPECT_EQ(loss({}, {}).force, 0);
  EXPECT_TRUE(std::isinf(loss({}, received).force));
}

TEST(Resultant, RefusesUnequalLengths) {
  EXPECT_THROW(resultant(std::vector<Vec3>(2), std::vector<Vec3>(3), Vec3::Zero()),
               std::invalid_argument);
}

}  // namespace
}  // namespace acopla::coupler
