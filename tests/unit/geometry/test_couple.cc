#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <random>
#include <vector>

#include "geometry/couple.h"

namespace acopla::geometry {
namespace {

Vec3 sum_of(const std::vector<Vec3>& forces) {
  Vec3 sum = Vec3::Zero();
  for (const auto& force : forces) sum += force;
  return sum;
}

Vec3 moment_of(const std::vector<Vec3>& nodes, const std::vector<Vec3>& forces) {
  Vec3 moment = Vec3::Zero();
  for (std::size_t k = 0; k < nodes.size(); ++k) moment += nodes[k].cross(forces[k]);
  return moment;
}

TEST(CoupleForces, SumToZeroAndTurnByTheCouple) {
  // Statics, exact. 1e-12 of a couple of order 1: triangles with a height of a hundredth of their
  // edge lose two digits.
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> coordinate(-1, 1);
  const auto draw = [&] {
    return Vec3(coordinate(random), coordinate(random), coordinate(random));
  };
  for (std::size_t count = 3; count <= 9; ++count)
    for (int trial = 0; trial < 50; ++trial) {
      std::vector<Vec3> nodes(count), forces(count);
      for (auto& node : nodes) node = draw();
      const Vec3 couple = draw();
      ASSERT_TRUE(couple_forces(nodes, couple, forces));
      EXPECT_LT(sum_of(forces).norm(), 1e-12);
      EXPECT_LT((moment_of(nodes, forces) - couple).norm(), 1e-12);
    }
}

TEST(CoupleForces, OfNoCoupleAreZeroOnAnyNodes) {
  const std::vector<Vec3> nodes{{0, 0, 0}, {0, 0, 0}};
  std::vector<Vec3> forces(2, Vec3(1, 1, 1));
  EXPECT_TRUE(couple_forces(nodes, Vec3::Zero(), forces));
  EXPECT_EQ(forces[0], Vec3::Zero());
}

TEST(CoupleForces, TwoNodesCarryACouplePerpendicularToTheirLine) {
  // A couple of 6 N m about z on nodes 3 m apart along x is ±2 N along y.
  const std::vector<Vec3> nodes{{1, 5, 0}, {4, 5, 0}};
  std::vector<Vec3> forces(2);
  ASSERT_TRUE(couple_forces(nodes, {0, 0, 6}, forces));
  EXPECT_LT((forces[0] - Vec3(0, -2, 0)).norm(), 1e-14);
  EXPECT_LT((forces[1] - Vec3(0, 2, 0)).norm(), 1e-14);
}

TEST(CoupleForces, NodesOnAnyLineCarryWhatIsPerpendicularToIt) {
  std::mt19937_64 random(4);
  std::uniform_real_distribution<double> coordinate(-1, 1);
  const auto draw = [&] {
    return Vec3(coordinate(random), coordinate(random), coordinate(random));
  };
  for (int trial = 0; trial < 100; ++trial) {
    const Vec3 origin = draw(), along = draw();
    const std::vector<Vec3> nodes{origin, origin + along, origin + 0.3 * along};
    const Vec3 couple = along.cross(draw());
    std::vector<Vec3> forces(3);
    ASSERT_TRUE(couple_forces(nodes, couple, forces));
    EXPECT_LT(sum_of(forces).norm(), 1e-12);
    EXPECT_LT((moment_of(nodes, forces) - couple).norm(), 1e-12);
  }
}

TEST(CoupleForces, RefuseACoupleAboutTheLineOfTheirNodes) {
  const std::vector<Vec3> nodes{{0, 0, 0}, {1, 1, 0}, {2, 2, 0}};
  std::vector<Vec3> forces(3, Vec3(1, 1, 1));
  EXPECT_FALSE(couple_forces(nodes, {1, 1, 0}, forces));
  for (const auto& force : forces) EXPECT_EQ(force, Vec3::Zero());
  EXPECT_FALSE(
      couple_forces(nodes, {1e-6, 1e-6, 1}, forces));  // a small part about the line is a part
}

TEST(CoupleForces, RefuseASliverAndNodesThatCoincide) {
  std::vector<Vec3> forces(3);
  EXPECT_FALSE(
      couple_forces(std::vector<Vec3>{{0, 0, 0}, {1, 0, 0}, {0.5, 1e-5, 0}}, {1, 0, 0}, forces));
  EXPECT_FALSE(couple_forces(std::vector<Vec3>(3, Vec3(0.1, 0.7, 0.3)), {0, 0, 1}, forces));
}

}  // namespace
}  // namespace acopla::geometry
