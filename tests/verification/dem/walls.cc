// Walls behave like particles: the same impacts, with every law, on a particle, a plane, a facet, an edge and a vertex.
//
// On a vertex or an edge the normal turns as the ball moves along, so a fast oblique impact is another one than on a plane. At 1e-5 m/s the
// ball moves by 1e-4 of its radius or less while it touches, and the impacts are the same but for that. The particle is 10⁴ times as large, which
// makes it as flat, and 10¹² times as heavy (10⁸ times in the plane): it does not move.
#include <gtest/gtest.h>

#include <cmath>

#include "dem/step.h"
#include "setup.h"

namespace acopla::dem::verification {
namespace {

constexpr double radius = 0.01;

enum class Partner { particle, plane, facet, edge, vertex };

const char* name_of(Partner partner) {
  constexpr const char* names[] = {"particle", "plane", "facet", "edge", "vertex"};
  return names[static_cast<int>(partner)];
}

// All with their highest point at the origin, y up; the edge along x.
std::vector<Wall> wall_of(Partner partner, int dimension) {
  switch (partner) {
    case Partner::particle: return {};
    case Partner::plane: return {plane(Vec3::Zero(), Vec3::UnitY())};
    case Partner::facet:
      if (dimension == 2) return {line({Vec3(-1, 0, 0), Vec3(1, 0, 0)})};
      return {mesh({{-1, 0, -1}, {1, 0, -1}, {0, 0, 1}}, {{0, 2, 1}})};
    case Partner::edge: return {mesh({{-1, 0, 0}, {1, 0, 0}, {0, -1, 1}, {0, -1, -1}}, {{0, 2, 1}, {0, 1, 3}})};
    case Partner::vertex:
      if (dimension == 2) return {line({Vec3(-1, -1, 0), Vec3(0, 0, 0), Vec3(1, -1, 0)})};
      return {mesh({{0, 0, 0}, {1, -1, 0}, {-0.5, -1, 0.9}, {-0.5, -1, -0.9}}, {{0, 2, 1}, {0, 3, 2}, {0, 1, 3}})};
  }
  return {};
}

struct LawsOfContact {
  const char* normal;  // "hertz" or "linear"
  bool friction;
  const char* rolling;
};

OneMaterial material(int dimension, const LawsOfContact& laws, double e) {
  OneMaterial setup;
  setup.dimension = dimension;
  const bool hertz = std::string(laws.normal) == "hertz";
  setup.shear_modulus = 5e6;
  setup.poisson = 0.25;
  setup.normal = hertz ? "\"hertz\"" : linear(1e4);
  if (laws.friction) setup.tangential = hertz ? "\"mindlin\"" : linear_slider(20, std::nan(""));
  if (std::string(laws.rolling) == "constant_torque") setup.rolling = "\"constant_torque\"";
  if (std::string(laws.rolling) == "elastic_plastic") setup.rolling = elastic_plastic(0.3, 1, dimension == 3 ? 0.5 : 0);
  setup.friction = 0.3;
  setup.rolling_friction = 0.1;
  setup.restitution = e;
  return setup;
}

struct Motion {
  Vec3 velocity, spin;
  double duration = 0;  // of the impact, to a step or two
};

/// What a ball that comes from just above the origin leaves with.
Motion after_impact(const OneMaterial& setup, Partner partner, const Motion& before) {
  const auto scene = scene_of(setup);
  const double speed = -before.velocity[1], step = 0.05 * critical_step(scene).seconds;
  std::vector<Body> bodies{{Vec3(0, radius + 0.4 * speed * step, 0), radius, before.velocity, before.spin}};
  if (partner == Partner::particle) bodies.push_back({Vec3(0, -1e4 * radius, 0), 1e4 * radius});
  const auto engine = engine_of(scene, bodies, wall_of(partner, setup.dimension));
  std::uint64_t steps = 0;
  do {
    engine->advance(1, step);
    ++steps;
  } while (steps < 100000 && (steps < 3 || engine->contact_count() > 0));
  EXPECT_LT(steps, 100000u);
  return {velocity(*engine), spin(*engine), engine->time()};
}

class SlowImpact : public testing::TestWithParam<int> {};

TEST_P(SlowImpact, IsTheSameOnEveryPartnerWithEveryLaw) {
  const int dimension = GetParam();
  const std::vector<LawsOfContact> all{{"hertz", false, "none"},           {"hertz", true, "none"},
                                       {"hertz", true, "constant_torque"}, {"hertz", true, "elastic_plastic"},
                                       {"linear", false, "none"},          {"linear", true, "none"},
                                       {"linear", true, "constant_torque"}, {"linear", true, "elastic_plastic"}};
  // A facet and, to 1e-4, the particle have a normal that stands still.
  std::vector<Partner> partners{Partner::particle, Partner::facet, Partner::vertex};
  if (dimension == 3) partners.push_back(Partner::edge);
  const double speed = 1e-5;
  for (const auto& laws : all)
    for (const double e : {0.3, 1.0})
      for (const double tangential : {0.0, 0.2, 1.0, 4.0}) {
        Motion before{speed * Vec3(tangential, -1, dimension == 3 ? 0.3 * tangential : 0), Vec3::Zero()};
        before.spin = speed / radius * (dimension == 3 ? Vec3(0.3, 0.5, -0.4) : Vec3(0, 0, -0.4));
        const auto setup = material(dimension, laws, e);
        const auto on_plane = after_impact(setup, Partner::plane, before);
        for (const auto partner : partners) {
          const auto found = after_impact(setup, partner, before);
          // How far the normal turns, on the impulse of the impact and on the speed along it; and the particle is flat to 1e-4.
          const double turn = tangential * speed * on_plane.duration / radius;
          const double tolerance = speed * (1e-4 + (1 + e) * (1 + tangential) * turn);
          EXPECT_LT((found.velocity - on_plane.velocity).norm(), tolerance)
              << name_of(partner) << ", " << dimension << "D, " << laws.normal << ", " << laws.rolling << ", e " << e << ", slip " << tangential;
          EXPECT_LT((found.spin - on_plane.spin).norm() * radius, tolerance)
              << name_of(partner) << ", " << dimension << "D, " << laws.normal << ", " << laws.rolling << ", e " << e << ", slip " << tangential;
        }
        // And it is an impact: it leaves, and nothing is gained.
        EXPECT_NEAR(on_plane.velocity[1], e * speed, 0.03 * speed);
        const double inertia = (dimension == 3 ? 0.4 : 0.5) * radius * radius;
        EXPECT_LE(on_plane.velocity.squaredNorm() + inertia * on_plane.spin.squaredNorm(),
                  (1 + 1e-3) * (before.velocity.squaredNorm() + inertia * before.spin.squaredNorm()));
      }
}
INSTANTIATE_TEST_SUITE_P(InTwoAndThreeDimensions, SlowImpact, testing::Values(2, 3));

TEST(FastImpact, OnAFacetAndAlongAnEdgeIsThatOnAPlane) {
  // There the normal does not turn: the same numbers to round-off, whatever the speed.
  for (const char* normal : {"hertz", "linear"})
    for (const char* rolling : {"none", "constant_torque", "elastic_plastic"})
      for (const double e : {0.3, 0.9}) {
        const Motion before{Vec3(0.8, -0.5, 0), Vec3(0, 0, -20)};
        const auto flat = material(2, {normal, true, rolling}, e), ball = material(3, {normal, true, rolling}, e);
        const auto check = [&](const OneMaterial& setup, Partner partner) {
          const auto expected = after_impact(setup, Partner::plane, before), found = after_impact(setup, partner, before);
          EXPECT_LT((found.velocity - expected.velocity).norm(), 1e-12) << normal << ", " << rolling << ", " << name_of(partner);
          EXPECT_LT((found.spin - expected.spin).norm() * radius, 1e-12) << normal << ", " << rolling << ", " << name_of(partner);
        };
        check(flat, Partner::facet);
        check(ball, Partner::facet);
        check(ball, Partner::edge);
      }
}

TEST(TriangulatedFloor, RollingOverItWithEveryLawIsRollingOnAPlane) {
  // A ball rolls 0.25 m over triangles of 0.02 m, slowed by rolling resistance: the plane's motion to round-off.
  for (const char* normal : {"hertz", "linear"})
    for (const char* rolling : {"none", "constant_torque", "elastic_plastic"}) {
      auto setup = material(3, {normal, true, rolling}, 0.5);
      setup.gravity = Vec3(0, -standard_gravity, 0);
      setup.rolling_friction = 0.02;
      const auto scene = scene_of(setup);
      std::vector<Vec3> points;
      std::vector<std::array<std::uint32_t, 3>> triangles;
      const int n = 20;
      for (int k = 0; k <= n; ++k)
        for (int i = 0; i <= n; ++i) points.emplace_back(0.02 * i - 0.2 + 0.004 * std::sin(3.0 * k), 0, 0.02 * k - 0.2 + 0.004 * std::sin(5.0 * i));
      const auto at = [&](int i, int k) { return static_cast<std::uint32_t>(k * (n + 1) + i); };
      for (int k = 0; k < n; ++k)
        for (int i = 0; i < n; ++i) {
          triangles.push_back({at(i, k), at(i, k + 1), at(i + 1, k)});
          triangles.push_back({at(i + 1, k), at(i, k + 1), at(i + 1, k + 1)});
        }
      const std::vector<Body> ball{{Vec3(-0.13, radius, -0.03), radius, Vec3(0.5, 0, 0.11), Vec3(0.11, 0, -0.5) / radius}};
      const auto on_plane = engine_of(scene, ball, {plane(Vec3::Zero(), Vec3::UnitY())});
      const auto on_mesh = engine_of(scene, ball, {mesh(points, triangles)});
      const double step = 0.2 * critical_step(scene).seconds;
      const auto steps = static_cast<std::uint64_t>(0.5 / step);
      on_plane->advance(steps, step);
      on_mesh->advance(steps, step);
      // Some thousand steps of a motion that is not chaotic.
      EXPECT_LT((position(*on_plane) - position(*on_mesh)).norm(), 1e-11) << normal << ", " << rolling;
      EXPECT_LT((velocity(*on_plane) - velocity(*on_mesh)).norm(), 1e-10) << normal << ", " << rolling;
      EXPECT_GT(position(*on_mesh)[0], 0.05);
    }
}

}  // namespace
}  // namespace acopla::dem::verification
