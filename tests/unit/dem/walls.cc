// Triangle walls: they must behave like the surface they describe, not like the triangles it was cut into.
#include <gtest/gtest.h>

#include "scenes.h"

namespace acopla::dem::test {
namespace {

TEST(TriangleWall, BallOnATriangulatedFloorDoesNotFeelTheEdges) {
  // The same throw on a plane and on 200 triangles: sliding, sticking, rolling, bouncing over edges and vertices. The force
  // must be the plane's to 1e-12; over half a second of a non-chaotic motion the trajectories may part by a little more.
  for (const auto& laws : {hertz_mindlin, linear_slider, with_rolling(hertz_mindlin, 0.03)}) {
    auto scene = scene_of(laws);
    scene.gravity = Vec3(0, 0, -9.81);
    const std::vector<Ball> balls{{Vec3(-0.15, -0.07, radius + 0.002), Vec3(0.6, 0.31, 0), Vec3(3, -2, 5)}};
    const auto on_plane = engine_with(scene, balls, {plane(Vec3::Zero(), Vec3::UnitZ())});
    const auto on_mesh = engine_with(scene, balls, {triangulated_floor(0.4, 10)});
    const double step = 0.2 * critical_step(scene).seconds;
    const auto steps = static_cast<unsigned>(std::lround(0.013 / step));
    for (int window = 0; window < 40; ++window) {
      on_plane->advance(steps, step);
      on_mesh->advance(steps, step);
      EXPECT_LT((position(*on_plane) - position(*on_mesh)).norm(), 1e-12);
      EXPECT_LT((velocity(*on_plane) - velocity(*on_mesh)).norm(), 1e-11);
      EXPECT_LT((spin(*on_plane) - spin(*on_mesh)).norm(), 1e-9);
      EXPECT_LT((on_plane->wall_load().walls[0].force - on_mesh->wall_load().walls[0].force).norm(), 1e-10 * mass * 9.81 * 10);
    }
    EXPECT_GT(position(*on_mesh)[0], 0.03);  // it came from -0.15 across triangles of 0.08
  }
}

TEST(TriangleWall, VertexForcesCarryForceAndMoment) {
  // Moment about the origin of the vertex forces against the torque that gravity and the particles' change of angular
  // momentum demand.
  auto scene = scene_of(with_rolling(hertz_mindlin, 0.2));
  scene.gravity = Vec3(0, 0, -9.81);
  const auto engine = engine_with(scene, {{Vec3(0.013, 0.027, radius), Vec3(0.3, 0.1, -0.2), Vec3(10, 20, 30)}}, {triangulated_floor(0.2, 7)});
  const double step = 0.1 * critical_step(scene).seconds;
  const WallSet walls({triangulated_floor(0.2, 7)});
  for (int window = 0; window < 20; ++window) {
    const auto angular = [&] {
      return Vec3(mass * position(*engine).cross(velocity(*engine)) + 0.4 * mass * radius * radius * spin(*engine));
    };
    const Vec3 before = angular(), x0 = position(*engine), weight = mass * scene.gravity;
    engine->advance(1, step);  // one step: the lever arm of the weight is known
    const Vec3 mean_arm = 0.5 * (x0 + position(*engine));
    Vec3 moment = Vec3::Zero();
    const auto& load = engine->wall_load();
    for (std::uint32_t v = 0; v < load.vertex_force[0].size(); ++v) moment += walls.vertex(v).cross(load.vertex_force[0][v]);
    const Vec3 lost = mean_arm.cross(weight) - (angular() - before) / step;
    // Exact for velocity Verlet; what is left is the round-off of a difference over one step, on the scale of the weight's moment.
    EXPECT_LT((moment - lost).norm(), 1e-9 * (mass * 9.81 * 0.03 + moment.norm()));
    EXPECT_EQ(load.couples_lost, 0u);
  }
}

}  // namespace
}  // namespace acopla::dem::test
