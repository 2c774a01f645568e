// What is sent: forces on vertices must carry the force and the moment of the contacts, whatever the wall is made of and how it moves.
#include <gtest/gtest.h>

#include "wall_scenes.h"

namespace acopla::dem::test::walls {
namespace {

struct Case {
  const char* name;
  int dimension;
  Wall wall;
};

std::vector<Case> cases() {
  const auto hills = terrain(0.1, 6, [](double x, double y) { return 0.01 * std::sin(40 * x) * std::cos(30 * y); });
  const auto crooked = line({{-0.1, 0.01, 0}, {-0.05, 0, 0}, {0, 0.005, 0}, {0.04, -0.01, 0}, {0.1, 0, 0}});
  const auto turn_3 = Motion::rotation({0.02, 0.01, 0.3}, Vec3(0.1, 0.2, 1).normalized(), 3);
  const auto turn_2 = Motion::rotation({0.02, 0.3, 0}, Vec3::UnitZ(), 3);
  return {{"mesh", 3, hills},
          {"plane", 3, plane({0, 0, 0.002}, Vec3::UnitZ())},
          {"turning mesh", 3, moved(hills, turn_3)},
          {"glued mesh", 3, glued(hills, 0.006)},
          {"turning glued mesh", 3, moved(glued(hills, 0.006), turn_3)},
          {"deforming mesh", 3, moved(hills, Motion::prescribed())},
          {"deforming glued mesh", 3, moved(glued(hills, 0.006), Motion::prescribed())},
          {"line", 2, crooked},
          {"turning line", 2, moved(crooked, turn_2)},
          {"glued line", 2, glued(crooked, 0.006)},
          {"deforming glued line", 2, moved(glued(crooked, 0.006), Motion::prescribed())}};
}

// Discs or spheres that sink into the wall's neighbourhood, with velocities and spins.
std::vector<Body> bodies_on(int dimension) {
  std::mt19937 random(17);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<Body> bodies;
  for (int k = 0; k < 30; ++k) {
    Body body;
    body.at = dimension == 3 ? Vec3(0.08 * uniform(random), 0.08 * uniform(random), 0.015) : Vec3(0.09 * uniform(random), 0.016, 0);
    body.velocity = dimension == 3 ? Vec3(uniform(random), uniform(random), -1) : Vec3(uniform(random), -1, 0);
    body.spin = dimension == 3 ? Vec3(20 * uniform(random), 20 * uniform(random), 20 * uniform(random)) : Vec3(0, 0, 20 * uniform(random));
    bodies.push_back(body);
  }
  return bodies;
}

TEST(WallLoad, VertexForcesCarryForceMomentAndPower) {
  for (const auto& [name, dimension, wall] : cases()) {
    auto kernels = dimension == 3 ? table_of<RollingHertzMindlin, 3>(glass()) : table_of<RollingSlider, 2>(glass());
    Drop drop(dimension, std::move(kernels), {wall}, bodies_on(dimension), Vec3::Zero(), 0.2 * radius);
    std::vector<Vec3> displacement, velocity;
    if (wall.motion.kind() == Motion::Kind::prescribed) {
      for (const auto& x : drop.walls.positions(0)) {
        displacement.emplace_back(0.01 * x[1], 0.02 * x[0], 0);
        velocity.emplace_back(0.3 * x[1], 0.2 * x[0], dimension == 3 ? 0.5 * x[0] - x[1] : 0);
      }
      drop.walls.prescribe(0, displacement, velocity, 0);
    }
    drop.start(1e-6);
    std::size_t most = 0;
    for (int step = 0; step < 400; ++step) {
      drop.advance(1, 2e-5);
      most = std::max(most, drop.contacts.contact_count());
      // The load of the last instant alone: a window of no step but its edge.
      drop.sum.begin();
      auto load = drop.sum.finish(drop.walls, 1);  // edge/2 + edge/2
      Vec3 force = Vec3::Zero(), moment = Vec3::Zero();  // of the particles, about the wall's reference
      double scale = 1e-300, turns = 1e-300;
      for (std::uint32_t i = 0; i < drop.particles.size(); ++i) {
        const Vec3 arm = drop.at(i) - drop.walls.reference(0);
        force += drop.force(i);
        moment += arm.cross(drop.force(i)) + drop.torque(i);
        scale += drop.force(i).norm();
        turns += arm.norm() * drop.force(i).norm() + drop.torque(i).norm();
      }
      EXPECT_LT((load.walls[0].force + force).norm(), 1e-13 * scale) << name;
      EXPECT_LT((load.walls[0].torque + moment).norm(), 1e-13 * turns) << name;
      if (wall.is_plane) continue;
      Vec3 sent = Vec3::Zero(), turned = Vec3::Zero();
      double power = 0;
      const auto positions = drop.walls.positions(0);
      for (std::size_t v = 0; v < positions.size(); ++v) {
        const Vec3 own = drop.walls.rotation(0) * load.vertex_force[0][v];
        sent += own;
        turned += (positions[v] - drop.walls.reference(0)).cross(own);
        const Vec3 moves = velocity.empty() ? drop.walls.rigid_velocity(0, positions[v]) : velocity[v];
        power -= own.dot(moves);
      }
      EXPECT_LT((sent + force).norm(), 1e-13 * scale) << name;
      // The couples go through the inverse of a triangle's inertia, whose shape costs a digit or two.
      EXPECT_LT((turned + moment).norm(), 1e-12 * turns) << name;
      EXPECT_NEAR(load.walls[0].power, power, 1e-12 * (3 * turns + scale)) << name;
      EXPECT_EQ(load.couples_lost, 0u);
    }
    EXPECT_GT(most, 7u) << name;
  }
}

TEST(WallLoad, IsTheMeanThatTheParticlesLost) {
  // Momentum lost over windows of any length, to round-off.
  for (const auto& [name, dimension, wall] : cases()) {
    if (wall.motion.kind() == Motion::Kind::prescribed) continue;
    auto kernels = dimension == 3 ? table_of<HertzMindlin, 3>(glass()) : table_of<Slider, 2>(glass());
    Drop drop(dimension, std::move(kernels), {wall}, bodies_on(dimension), Vec3::Zero(), 0.2 * radius);
    const auto momentum = [&] {
      Vec3 sum = Vec3::Zero();
      for (std::size_t i = 0; i < drop.particles.size(); ++i) sum += drop.particles.mass_of(i) * drop.particles.velocity_of(i);
      return sum;
    };
    double received = 0;
    for (const int steps : {1, 7, 100, 30, 1, 250}) {
      const Vec3 before = momentum();
      const auto load = drop.advance(steps, 2e-5);
      const double scale = 30 * drop.particles.mass_of(0) * 1.5;
      EXPECT_LT((load.walls[0].force * steps * 2e-5 + momentum() - before).norm(), 1e-14 * scale) << name;
      received += load.walls[0].force.norm();
      if (wall.is_plane || wall.motion.moves()) continue;
      Vec3 sent = Vec3::Zero();
      for (const auto& force : load.vertex_force[0]) sent += force;
      EXPECT_LT((sent - load.walls[0].force).norm(), 1e-13 * scale / 2e-5);
    }
    EXPECT_GT(received, 0);
  }
}

TEST(WallLoad, NothingIsKeptForVerticesThatNobodyAskedFor) {
  const auto hills = triangulated_floor(0.1, 6);
  Drop drop(3, table_of<HertzMindlin, 3>(glass()), {hills, hills}, bodies_on(3), Vec3::Zero(), 0.1 * radius, false);
  drop.walls.send(1);
  drop.sum = WallLoadSum(drop.walls, 1);
  const auto load = drop.advance(10, 1e-5);
  EXPECT_TRUE(load.vertex_force[0].empty());
  EXPECT_EQ(load.vertex_force[1].size(), hills.mesh.points.size());
  EXPECT_EQ(drop.sum.of(0).vertex.size(), hills.mesh.points.size());
}

}  // namespace
}  // namespace acopla::dem::test::walls
