// Shapes of walls: they must behave like the surface they describe, not like the pieces it was cut into.
#include <gtest/gtest.h>

#include <algorithm>

#include "wall_scenes.h"

namespace acopla::dem::test::walls {
namespace {

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
  for (const auto& vertex : walls.positions(0))
    if (std::abs(vertex[0]) < 0.09 && std::abs(vertex[1]) < 0.09) {
      EXPECT_EQ(contacts_at(walls, vertex + Vec3(0, 0, 0.95 * radius)).size(), 1u);
    }
}

// In the plane.

TEST(SplitLine, PullsAndPushesLikeThePlane) {
  // A disc thrown on the line y = 0 and on the same line in 24 pieces: sliding, sticking, rolling over their ends.
  for (const bool rolling : {false, true}) {
    const auto kernels = [&] { return rolling ? table_of<RollingSlider, 2>(glass()) : table_of<Slider, 2>(glass()); };
    const std::vector<Body> disc{{{-0.15, radius + 0.001, 0}, {0.6, 0, 0}, {0, 0, -5}}};
    const Vec3 gravity(0, -9.81, 0);
    Drop on_plane(2, kernels(), {plane(Vec3::Zero(), Vec3::UnitY())}, disc, gravity), on_line(2, kernels(), {split_line(0.2, 24)}, disc, gravity);
    const double step = 0.01 * std::sqrt(disc_mass / 1e4);
    double last = 0;
    for (int window = 0; window < 40; ++window) {
      const auto expected = on_plane.advance(100, step), load = on_line.advance(100, step);
      EXPECT_LT((on_line.at() - on_plane.at()).norm(), 1e-12 * 0.2);
      EXPECT_LT((on_line.particles.velocity_of(0) - on_plane.particles.velocity_of(0)).norm(), 1e-12);
      EXPECT_LT((on_line.particles.spin_of(0) - on_plane.particles.spin_of(0)).norm(), 1e-10);
      EXPECT_LT((load.walls[0].force - expected.walls[0].force).norm(), 1e-12 * 30 * disc_mass * 9.81);  // force of the impact
      last = on_line.at()[0];
    }
    EXPECT_GT(last, -0.1);
    EXPECT_GT(on_line.rebuilds, 20);
  }
}

TEST(SplitLine, DepthOfADiscOverAnEndIsThatOverTheMiddle) {
  const WallSet set({split_line(0.2, 24)});
  for (double x = -0.19; x < 0.19; x += 0.0003) {
    const auto found = contacts_at(set, {x, 0.9 * radius, 0});
    ASSERT_EQ(found.size(), 1u);
    EXPECT_NEAR(found[0].distance, 0.9 * radius, 1e-17);
    EXPECT_LT((found[0].normal - Vec3::UnitY()).norm(), 1e-15);
  }
  for (const auto& corner : set.positions(0)) {
    if (std::abs(corner[0]) < 0.19) {
      EXPECT_EQ(contacts_at(set, corner + Vec3(0, -0.95 * radius, 0)).size(), 1u);
    }
  }
}

TEST(CornerOfALine, ConcaveHasTwoContactsAndConvexHasOne) {
  const WallSet set({line({{-1, 1, 0}, {0, 0, 0}, {1, 1, 0}})});
  const double inside = 0.99 * radius * std::sqrt(2.0);
  const auto concave = contacts_at(set, {0, inside, 0});
  ASSERT_EQ(concave.size(), 2u);
  std::vector<double> weights(2);
  share_creases(radius, concave, weights);
  EXPECT_EQ(weights[0], 1);
  EXPECT_EQ(weights[1], 1);
  const auto convex = contacts_at(set, {0, -0.99 * radius, 0});
  ASSERT_EQ(convex.size(), 1u);
  EXPECT_NEAR(convex[0].distance, 0.99 * radius, 1e-17);
  EXPECT_EQ(convex[0].normal, Vec3(0, -1, 0));
  EXPECT_EQ(convex[0].feature_size, 1);
}

TEST(ClosedLine, HoldsFromWithinAndFromWithout) {
  const WallSet set({line({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, true)});
  EXPECT_EQ(set.facet(3), (std::array<std::uint32_t, 3>{3, 0, WallSet::none}));
  EXPECT_EQ(contacts_at(set, {0.9 * radius, 0.5, 0}).size(), 1u);
  EXPECT_EQ(contacts_at(set, {-0.9 * radius, 0.5, 0}).size(), 1u);
  EXPECT_EQ(contacts_at(set, {0.9 * radius, 0.9 * radius, 0}).size(), 2u);
}

// Glued particles.

TEST(GluedLine, HasAParticleAtEveryVertexAndAsManyBetweenAsFit) {
  const std::vector<Vec3> corners{{0, 0, 0}, {0.1, 0, 0}, {0.1, 0.035, 0}, {0, 0.05, 0}};
  for (const bool closed : {false, true}) {
    const WallSet set({glued(line(corners, closed), 0.01)});
    const auto particles = set.glued_particles(0);
    for (const auto& corner : corners)
      EXPECT_EQ(std::count_if(particles.begin(), particles.end(), [&](const Record& p) { return (p.vector() - corner).norm() < 1e-15; }), 1);
    // 10, 3, 10 (of 0.10112) and 5 stretches; the last one only where the line is closed.
    EXPECT_EQ(particles.size(), closed ? 28u : 24u);
    for (const auto& particle : particles) {
      EXPECT_EQ(particle.w, 0.005);
      for (const auto& other : particles)
        if (&other != &particle) {
          EXPECT_GT((other.vector() - particle.vector()).norm(), 0.01 - 1e-15);
        }
    }
  }
}

TEST(GluedLine, ADiscOverAGluedParticleMeetsADiscOfItsSize) {
  const WallSet set({glued(line({{0, 0, 0}, {0.1, 0, 0}}), 0.004)});
  std::vector<std::uint32_t> near;
  const Vec3 centre(0.041, 0.0115, 0);  // between the discs at 0.04 and 0.044
  set.find_near(centre, radius, near);
  ASSERT_EQ(near.size(), 2u);
  NearestPoint contact;
  ASSERT_TRUE(set.touches(near[0], centre, radius, contact));
  EXPECT_TRUE(set.is_ball(near[0]));
  EXPECT_EQ(set.curvature(near[0]), 500);
  EXPECT_NEAR(contact.distance, std::hypot(0.001, 0.0115) - 0.002, 1e-17);
  EXPECT_LT((contact.point - (Vec3(0.04, 0, 0) + 0.002 * contact.normal)).norm(), 1e-16);
}

TEST(GluedMesh, CoversTrianglesWithoutHolesAndWithoutDoubles) {
  const auto hills = terrain(0.1, 4, [](double x, double y) { return 0.02 * std::sin(30 * x) * std::cos(20 * y); });
  const WallSet set({glued(hills, 0.01)});
  const auto particles = set.glued_particles(0);
  for (std::size_t a = 0; a < particles.size(); ++a)
    for (std::size_t b = 0; b < a; ++b) EXPECT_GT((particles[a].vector() - particles[b].vector()).norm(), 1e-3);
  // No point of the surface is farther from a centre than the circumradius of the lattice allows: spacing < 2 diameters.
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(0, 1);
  for (int k = 0; k < 2000; ++k) {
    const auto& corners = set.facet(static_cast<std::uint32_t>(random() % hills.mesh.triangles.size()));
    double u = uniform(random), v = uniform(random);
    if (u + v > 1) u = 1 - u, v = 1 - v;
    const Vec3 at = (1 - u - v) * set.vertex(corners[0]) + u * set.vertex(corners[1]) + v * set.vertex(corners[2]);
    double nearest = 1;
    for (const auto& particle : particles) nearest = std::min(nearest, (particle.vector() - at).norm());
    EXPECT_LT(nearest, 0.01);
  }
}

TEST(GluedLine, MovesWithASurfaceThatDeforms) {
  WallSet set({moved(glued(line({{0, 0, 0}, {0.1, 0, 0}}), 0.01), Motion::prescribed())});
  set.prescribe(0, std::vector<Vec3>{{0, 0.02, 0}, {0.05, 0, 0}}, std::vector<Vec3>{{1, 0, 0}, {0, 1, 0}}, 0);
  set.move(0.01, 0.01);
  const Vec3 a(0.01, 0.02, 0), b(0.15, 0.01, 0);
  const auto particles = set.glued_particles(0);
  ASSERT_EQ(particles.size(), 11u);
  for (const auto& particle : particles) {
    const double u = (particle.x - a[0]) / (b[0] - a[0]);
    EXPECT_NEAR(10 * u, std::round(10 * u), 1e-13);
    EXPECT_LT((particle.vector() - ((1 - u) * a + u * b)).norm(), 1e-16);
  }
}

}  // namespace
}  // namespace acopla::dem::test::walls
