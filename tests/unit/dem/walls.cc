// Triangle walls: they must behave like the surface they describe, not like the triangles it was cut into.
#include <gtest/gtest.h>

#include "dem/wall/touching.h"
#include "scenes.h"

namespace acopla::dem::test {
namespace {

TEST(TriangleWall, BallOnATriangulatedFloorDoesNotFeelTheEdges) {
  // The same throw on a plane and on 200 triangles: sliding, sticking, rolling, bouncing over edges and vertices. The force
  // must be the plane's to 1e-12; over 4000 steps of a non-chaotic motion the trajectories may part by a little more.
  for (const auto& laws : {hertz_mindlin, linear_slider, with_rolling(hertz_mindlin, 0.03)}) {
    auto scene = scene_of(laws);
    scene.gravity = Vec3(0, 0, -9.81);
    const std::vector<Ball> balls{{Vec3(-0.15, -0.07, radius + 0.002), Vec3(0.6, 0.31, 0), Vec3(3, -2, 5)}};
    const auto on_plane = engine_with(scene, balls, {plane(Vec3::Zero(), Vec3::UnitZ())});
    const auto on_mesh = engine_with(scene, balls, {triangulated_floor(0.4, 10)});
    const double step = 0.2 * critical_step(scene).seconds;
    for (int window = 0; window < 40; ++window) {
      on_plane->advance(100, step);
      on_mesh->advance(100, step);
      EXPECT_LT((position(*on_plane) - position(*on_mesh)).norm(), 1e-12);
      EXPECT_LT((velocity(*on_plane) - velocity(*on_mesh)).norm(), 1e-11);
      EXPECT_LT((spin(*on_plane) - spin(*on_mesh)).norm(), 1e-9);
      EXPECT_LT((on_plane->wall_load().wall_force[0] - on_mesh->wall_load().wall_force[0]).norm(), 1e-10 * mass * 9.81 * 10);
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
    for (std::size_t v = 0; v < load.vertex_force.size(); ++v) moment += walls.vertices()[v].cross(load.vertex_force[v]);
    const Vec3 lost = mean_arm.cross(weight) - (angular() - before) / step;
    // Exact for velocity Verlet; what is left is the round-off of a difference over one step, on the scale of the weight's moment.
    EXPECT_LT((moment - lost).norm(), 1e-9 * (mass * 9.81 * 0.03 + moment.norm()));
    EXPECT_EQ(load.couples_lost, 0u);
  }
}

std::vector<NearestPoint> contacts_at(const WallSet& walls, const Vec3& centre, double r = radius) {
  std::vector<std::uint32_t> near;
  walls.find_near(centre, r, near);
  std::vector<NearestPoint> found;
  NearestPoint nearest;
  for (const auto element : near)
    if (walls.touches(element, centre, r, nearest)) found.push_back(nearest);
  keep_contacts(walls, r, found);
  return found;
}

// Normal force of a spring that is linear in the overlap, with the creases shared.
Vec3 spring_force(const WallSet& walls, const Vec3& centre) {
  const auto contacts = contacts_at(walls, centre);
  std::vector<double> weights(contacts.size());
  share_creases(radius, contacts, weights);
  Vec3 force = Vec3::Zero();
  for (std::size_t c = 0; c < contacts.size(); ++c) force += weights[c] * (radius - contacts[c].distance) * contacts[c].normal;
  return force / radius;
}

// Two faces that meet along y, each rising by `slope` from the horizontal.
WallSet crease(double slope) {
  const double c = std::cos(slope), s = std::sin(slope);
  return WallSet({mesh({{0, -1, 0}, {0, 1, 0}, {c, -1, s}, {c, 1, s}, {-c, -1, s}, {-c, 1, s}}, {{0, 2, 3}, {0, 3, 1}, {0, 1, 5}, {0, 5, 4}})});
}

TEST(ConcaveCorner, KeepsItsTwoOrThreeContacts) {
  EXPECT_EQ(contacts_at(crease(M_PI / 4), Vec3(0, 0.1, 0.99 * radius * std::sqrt(2.0))).size(), 2u);
  const WallSet corner({mesh({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 1, 2}, {0, 1, 3}, {0, 2, 3}})});
  const auto contacts = contacts_at(corner, Vec3::Constant(0.98 * radius));
  ASSERT_EQ(contacts.size(), 3u);
  std::vector<double> weights(3);
  share_creases(radius, contacts, weights);
  for (const double weight : weights) EXPECT_EQ(weight, 1);
}

TEST(ConcaveCrease, ResponseIsContinuousInTheDihedralAngle) {
  const Vec3 centre(0, 0.1, 0.99 * radius);
  const Vec3 flat = spring_force(crease(0), centre);
  EXPECT_NEAR(flat[2], 0.01, 1e-14);
  // At a height h over the crease both faces are at h cos(slope): the force must tend to the plane's as the slope goes to
  // zero, at first order in the slope (through cos it is the second, through the share of the patches the first).
  double last = 1;
  for (const double slope : {1e-2, 1e-3, 1e-4, 1e-6, 1e-9}) {
    const double jump = (spring_force(crease(slope), centre) - flat).norm() / flat.norm();
    EXPECT_LT(jump, 2e2 * slope * slope + 2 * slope + 1e-12) << slope;
    EXPECT_LE(jump, last + 1e-12);
    last = jump;
  }
}

TEST(ConcaveCrease, ForceHasNoJumpWhereABallCrossesIt) {
  for (const double slope : {1e-4, 1e-2, 0.05, 0.1, 0.3, 0.7}) {
    const auto walls = crease(slope);
    const double height = 0.99 * radius / std::cos(slope), reach = 2 * radius * std::sin(slope) + 0.1 * radius;
    Vec3 last = spring_force(walls, Vec3(-reach, 0.1, height));
    constexpr int steps = 20000;
    double largest = 0, scale = last.norm();
    for (int k = 1; k <= steps; ++k) {
      const Vec3 force = spring_force(walls, Vec3(-reach + 2 * reach * k / steps, 0.1, height));
      largest = std::max(largest, (force - last).norm());
      scale = std::max(scale, force.norm());
      last = force;
    }
    // A jump would not shrink with the steps: the largest change must be a small multiple of the mean change.
    EXPECT_LT(largest, 200 * scale / steps + 1e-12) << "slope " << slope;
  }
}

TEST(ConvexRidge, OneContactWhereverTheBallIs) {
  const auto ridge = crease(-0.4);
  for (double x = -0.5 * radius; x <= 0.5 * radius; x += 0.01 * radius)
    EXPECT_EQ(contacts_at(ridge, Vec3(x, 0.1, 0.9 * radius - std::abs(x) * 0.2)).size(), 1u) << x;
}

TEST(SharedVertex, ManyTrianglesAroundAVertexAreOneContact) {
  const WallSet walls({triangulated_floor(0.1, 4)});
  for (const auto& vertex : walls.vertices())
    if (std::abs(vertex[0]) < 0.09 && std::abs(vertex[1]) < 0.09) {
      EXPECT_EQ(contacts_at(walls, vertex + Vec3(0, 0, 0.95 * radius)).size(), 1u);
    }
}

}  // namespace
}  // namespace acopla::dem::test
