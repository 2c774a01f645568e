// Weight and squeeze: closed forms of statics for columns and rows of equal and very unequal particles, contacts that open, a silo.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "cases.h"
#include "dem/step.h"
#include "setup.h"

namespace acopla::dem::verification {
namespace {

OneMaterial resting(const std::string& law, double restitution = 0.5) {
  const auto& p = reference()["statics"]["parameters"];
  OneMaterial setup;
  setup.density = p["density"];
  setup.gravity = Vec3(0, -standard_gravity, 0);
  setup.restitution = restitution;
  if (law == "hertz") {
    // Y* = E/(2 (1 − ν²)) of two equal bodies.
    const double modulus = p["reduced_modulus_of_every_pair"];
    setup.normal = "\"hertz\"";
    setup.poisson = 0.25;
    setup.shear_modulus = modulus * 2 * (1 - 0.25 * 0.25) / (2 * 1.25);
  } else {
    setup.normal = linear(p["linear_stiffness"]);
  }
  return setup;
}

const std::vector<std::pair<std::string, std::vector<double>>>& columns() {
  static const std::vector<std::pair<std::string, std::vector<double>>> all{
      {"five_equal", {0.01, 0.01, 0.01, 0.01, 0.01}}, {"ratio_10", {0.01, 0.001, 0.01}}, {"ratio_100", {0.01, 0.0001, 0.01}}};
  return all;
}

TEST(Column, PutWhereStaticsPutsItDoesNotMove) {
  for (const auto& [name, radii] : columns())
    for (const std::string law : {"linear", "hertz"}) {
      const auto& expected = reference()["statics"]["values"]["column_" + name + "_" + law];
      auto setup = resting(law);
      setup.radius = *std::min_element(radii.begin(), radii.end());
      const auto scene = scene_of(setup);
      std::vector<Body> bodies;
      for (std::size_t k = 0; k < radii.size(); ++k) bodies.push_back({Vec3(0, expected["centres"][k], 0), radii[k]});
      const auto engine = engine_of(scene, bodies, {plane(Vec3::Zero(), Vec3::UnitY())});
      engine->advance(5000, 0.2 * critical_step(scene).seconds);
      for (std::uint32_t k = 0; k < radii.size(); ++k) {
        // The reference has 14 digits, 1e-16 m here.
        EXPECT_NEAR(position(*engine, k)[1], expected["centres"][k], 1e-15) << name << ", " << law << ", " << k;
        EXPECT_EQ(position(*engine, k)[0], 0) << "nothing pushes sideways";
      }
      const double floor = -engine->wall_load().walls[0].force[1], weight = expected["forces"][0];
      EXPECT_NEAR(floor, weight, 1e-9 * weight) << name << ", " << law;
    }
}

TEST(Column, PutTogetherTouchingComesToRestWhereStaticsSays) {
  // Overlaps are of 1e-6 to 1e-5 m. A body creeps home until v Δt is less than the last digit of its place: 3e-18 m over some 1e-8 s
  // against a drag of 1000 1/s leaves up to 1e-13 m.
  for (const auto& [name, radii] : columns())
    for (const std::string law : {"linear", "hertz"})
      for (const auto& figure : column(0.2, "column_" + name + "_" + law, radii).figures)
        EXPECT_NEAR(figure.value, figure.reference, figure.name[0] == 'c' ? 1e-13 : 1e-7 * figure.scale) << name << ", " << law << ", " << figure.name;
}

TEST(Column, TowerOfAHundredStands) {
  for (const std::string law : {"linear", "hertz"}) {
    const auto& expected = reference()["statics"]["values"]["column_tower_of_100_" + law];
    const auto scene = scene_of(resting(law));
    const double r = 0.01, weight = expected["floor_force"], each = weight / 100;
    const double modulus = reference()["statics"]["parameters"]["reduced_modulus_of_every_pair"];
    std::vector<Body> bodies;
    double height = 0;
    for (int k = 0; k < 100; ++k) {
      const double force = each * (100 - k), reduced = k == 0 ? r : r / 2;
      const double overlap = law == "linear" ? force / 1e5 : std::pow(force / (4.0 / 3 * modulus * std::sqrt(reduced)), 2.0 / 3);
      height += (k == 0 ? r : 2 * r) - overlap;
      bodies.push_back({Vec3(0, height, 0), r});
    }
    EXPECT_NEAR(height, expected["top_centre"], 1e-12);
    const auto engine = engine_of(scene, bodies, {plane(Vec3::Zero(), Vec3::UnitY())});
    engine->advance(20000, 0.2 * critical_step(scene).seconds);
    EXPECT_NEAR(position(*engine, 99)[1], height, 1e-13);
    EXPECT_NEAR(-engine->wall_load().walls[0].force[1], weight, 1e-9 * weight);
  }
}

TEST(Row, OfThreeSqueezedBetweenWallsCarriesOneForce) {
  // 10:1:10 and 100:1:100, walls 1e-6 m too close: one force through all four contacts. Forces are stiffness times differences of places,
  // which come home to 1e-13 m (as above) of overlaps of 1e-7 m.
  for (const std::string ratio : {"row_ratio_10", "row_ratio_100"})
    for (const std::string law : {"linear", "hertz"})
      for (const auto& figure : squeezed_row(0.2, ratio, law).figures)
        EXPECT_NEAR(figure.value, figure.reference, 1e-6 * figure.scale) << ratio << ", " << law << ", " << figure.name;
}

TEST(SizeRatio100, LargeBallRestsOnSmallOnesAndLeavesThemWithoutSticking) {
  // A ball of 0.1 m on three of 1 mm, a millionth of its mass each, on a floor; dashpots of restitution 0.01, the ones that would glue
  // if contacts could pull. At rest the floor carries the weight; lifted at 0.2 m/s, nothing holds the ball back and the floor is not pulled.
  for (const std::string law : {"linear", "hertz"}) {
    auto setup = resting(law, 0.01);
    setup.radius = 1e-3;
    if (law == "linear") setup.normal = linear(2e6);
    else setup.shear_modulus *= 50;
    setup.tangential = law == "linear" ? linear_slider(20, std::nan("")) : "\"mindlin\"";
    setup.friction = 0.5;
    const double big = 0.1, small = 1e-3, away = 5e-3;
    std::vector<Body> bodies{{Vec3(0, small + std::sqrt((big + small) * (big + small) - away * away), 0), big}};
    for (int k = 0; k < 3; ++k)
      bodies.push_back({Vec3(away * std::cos(2 * M_PI * k / 3), small, away * std::sin(2 * M_PI * k / 3)), small});
    const std::vector<Wall> floor{plane(Vec3::Zero(), Vec3::UnitY())};
    setup.more = "damping = { viscous = { translation = 1000 } }";
    auto scene = scene_of(setup);
    const double step = 0.2 * critical_step(scene).seconds;
    const auto resting_ball = engine_of(scene, bodies, floor);
    resting_ball->advance(static_cast<std::uint64_t>(0.05 / step), step);
    resting_ball->advance(1, step);
    const double weight = resting_ball->mass() * standard_gravity;
    EXPECT_NEAR(-resting_ball->wall_load().walls[0].force[1], weight, 1e-6 * weight) << law;  // the last creep on sticking friction
    EXPECT_LT(velocity(*resting_ball, 0).norm(), 1e-8) << law;

    // From there, without the drag.
    setup.more.clear();
    scene = scene_of(setup);
    for (std::uint32_t k = 0; k < 4; ++k) bodies[k].at = position(*resting_ball, k);
    const double start = 0.2, deepest = small + std::sqrt((big + small) * (big + small) - away * away) - bodies[0].at[1];
    bodies[0].velocity = Vec3(0, start, 0);
    const auto lifted = engine_of(scene, bodies, floor);
    double lowest = 0, strongest_pull = 0, opened = 0;
    while (lifted->time() < 5e-3) {
      lifted->advance(1, step);
      lowest = std::min(lowest, velocity(*lifted, 0)[1] - (start - standard_gravity * lifted->time()));
      strongest_pull = std::max(strongest_pull, lifted->wall_load().walls[0].force[1]);
      double nearest = INFINITY;
      for (std::uint32_t k = 1; k < 4; ++k) nearest = std::min(nearest, (position(*lifted, 0) - position(*lifted, k)).norm() - big - small);
      if (opened == 0 && nearest > 0) opened = lifted->time();
    }
    EXPECT_GE(lowest, -1e-12) << law << ": a contact pulled the ball down";  // round-off of some ten thousand steps
    EXPECT_LE(strongest_pull, 0) << law << ": the floor was pulled up";
    // Small balls spring back no faster than they were pressed in over the overdamped time of their dashpots; then the ball is gone.
    EXPECT_GT(opened, 0) << law;
    EXPECT_LT(opened, 100 * deepest / start) << law;
  }
}

// Discs fall into a slot ten of them wide.
struct Silo {
  double floor, sides, weight, kinetic;
};

Silo fill_silo(int rows, double friction, unsigned seed) {
  const double r = 0.005, width = 20.5 * r;
  OneMaterial setup;
  setup.dimension = 2;
  setup.gravity = Vec3(0, -standard_gravity, 0);
  setup.density = 1056;
  setup.radius = r;
  setup.normal = linear(6.5e4);
  setup.tangential = linear_slider(20, std::nan(""));
  setup.friction = friction;
  setup.rolling = elastic_plastic(0.3);  // without it single discs roll and rattle for long
  setup.rolling_friction = 0.05;
  setup.restitution = 0.3;
  const auto scene = scene_of(setup);
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> size(0.6, 1.0), shake(-0.02, 0.02);
  std::vector<Body> discs;
  for (int row = 0; row < rows; ++row)
    for (int k = 0; k < 10; ++k)
      discs.push_back({Vec3((2.05 * k + 1.03) * r + shake(random) * r, (2.05 * row + 1.03) * r, 0), size(random) * r, Vec3(0, -0.1, 0)});
  auto floor = plane(Vec3::Zero(), Vec3::UnitY());
  Timing timing;  // lowered by half a radius, so that the filling hangs on to the walls
  timing.start = 1.5;
  timing.stop = 2.0;
  timing.ramp = 0.1;
  floor.motion = Motion::translation(Vec3(0, -r, 0), timing);
  const auto engine = engine_of(scene, discs, {floor, plane(Vec3::Zero(), Vec3::UnitX()), plane(Vec3(width, 0, 0), -Vec3::UnitX())});
  const double step = 0.2 * critical_step(scene).seconds;
  engine->advance(static_cast<std::uint64_t>(4.0 / step), step);
  engine->advance(static_cast<std::uint64_t>(0.2 / step), step);
  const auto& load = engine->wall_load().walls;
  return {-load[0].force[1], -load[1].force[1] - load[2].force[1], engine->mass() * standard_gravity, engine->kinetic_energy()};
}

TEST(Silo, FloorAndWallsCarryTheWeightAndTheFloorsShareFallsWithDepth) {
  // Janssen (1895): friction on the walls takes a share of the weight that grows with depth. How large it is, is up to the bed's ratio of
  // stresses, which in a slot of ten discs differs between fillings: five fillings gave shares on the floor of 0.66 to 0.80 at a depth of
  // one width and 0.58 to 0.66 at two, where the formula with the usual ratio of 0.5 has 0.76 and 0.59.
  double low_share = 0, high_share = 0;
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const auto low = fill_silo(20, 0.5, seed), high = fill_silo(40, 0.5, seed);
    for (const auto& silo : {low, high}) {
      EXPECT_LT(silo.kinetic, 1e-11) << "at rest";
      EXPECT_NEAR((silo.floor + silo.sides) / silo.weight, 1, 1e-6);
    }
    low_share += low.floor / low.weight / 3;
    high_share += high.floor / high.weight / 3;
  }
  EXPECT_NEAR(low_share, 0.75, 0.08);
  EXPECT_NEAR(high_share, 0.62, 0.08);
  // Smooth walls carry nothing; smooth discs keep sliding a little.
  const auto smooth = fill_silo(20, 0, 1);
  EXPECT_NEAR(smooth.floor / smooth.weight, 1, 1e-4);
  EXPECT_EQ(std::abs(smooth.sides), 0);
}

}  // namespace
}  // namespace acopla::dem::verification
