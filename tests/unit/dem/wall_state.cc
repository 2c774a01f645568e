// Walls and their contacts in a checkpoint: the run goes on bit for bit.
#include <gtest/gtest.h>

#include "io/archive.h"
#include "wall_scenes.h"

namespace acopla::dem::test::walls {
namespace {

std::vector<Wall> all_kinds() {
  Servo servo;
  servo.direction = -Vec3::UnitZ();
  servo.force = 0.5;
  servo.mass = 0.05;
  servo.damping = 1;
  servo.max_speed = 1;
  return {moved(terrain(0.1, 7, [](double x, double y) { return 0.005 * std::sin(50 * x + 30 * y); }), Motion::rotation(Vec3::Zero(), Vec3::UnitZ(), 2)),
          moved(plane({0, 0, 2.2 * radius}, -Vec3::UnitZ()), Motion::servo(servo)),
          moved(plane({-0.06, 0, 0}, Vec3::UnitX()), Motion::vibration({1e-4, 0, 0}, 200, 0.3)),
          moved(glued(mesh({{0.06, -0.1, -0.1}, {0.06, 0.1, -0.1}, {0.06, 0, 0.1}}, {{0, 1, 2}}), 0.006), Motion::prescribed())};
}

TEST(WallState, RunGoesOnBitForBit) {
  std::mt19937 random(23);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<Body> bodies;
  for (int k = 0; k < 40; ++k)
    bodies.push_back({{0.045 * uniform(random), 0.045 * uniform(random), 1.55 * radius}, {2 * uniform(random), uniform(random), -0.5}, {1, 2, 3}});
  const auto drop = [&] { return Drop(3, table_of<RollingHertzMindlin, 3>(glass()), all_kinds(), bodies, {0, 0, -9.81}, 0.3 * radius); };
  Drop original = drop(), resumed = drop();
  const auto window = [&](Drop& run) {
    const std::vector<Vec3> displacement{{1e-4 * std::sin(50 * run.time), 0, 0}, {0, 0, 0}, {0, 0, 0}}, velocity{{5e-3 * std::cos(50 * run.time), 0, 0}, {0, 0, 0}, {0, 0, 0}};
    run.walls.prescribe(3, displacement, velocity, run.time);
    return run.advance(37, 1e-5);
  };
  std::size_t contacts = 0;
  for (int k = 0; k < 30; ++k) {
    window(original);
    contacts = std::max(contacts, original.contacts.contact_count());
  }
  io::State state;
  io::save(original, state);
  const int rebuilds = original.rebuilds;
  window(resumed);  // whatever it did before is forgotten
  io::restore(state, resumed);
  io::State again;
  io::save(resumed, again);
  EXPECT_TRUE(state == again);
  for (int k = 0; k < 30; ++k) {
    const auto expected = window(original), load = window(resumed);
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      ASSERT_EQ(original.at(i), resumed.at(i));
      ASSERT_EQ(original.particles.spin_of(i), resumed.particles.spin_of(i));
    }
    for (std::size_t w = 0; w < 4; ++w) {
      EXPECT_EQ(expected.walls[w].force, load.walls[w].force);
      EXPECT_EQ(expected.walls[w].power, load.walls[w].power);
      EXPECT_EQ(expected.vertex_force[w], load.vertex_force[w]);
    }
  }
  EXPECT_GT(contacts, 15u);
  EXPECT_GT(original.rebuilds, rebuilds);
}

}  // namespace
}  // namespace acopla::dem::test::walls
