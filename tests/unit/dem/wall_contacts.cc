// Lists of wall contacts: what they keep from step to step must not depend on how they are kept.
#include <gtest/gtest.h>

#include "wall_scenes.h"

namespace acopla::dem::test::walls {
namespace {

struct Found {
  std::uint32_t particle;
  double overlap;
  Vec3 normal;
};

std::vector<Found> present(const WallContactList& list) {
  std::vector<Found> found;
  list.for_each_contact([&](std::uint32_t particle, std::uint8_t, std::uint8_t, double overlap, const Vec3& normal, double) {
    found.push_back({particle, overlap, normal});
  });
  std::sort(found.begin(), found.end(), [](const Found& a, const Found& b) {
    return std::tuple(a.particle, std::round(a.overlap * 1e12), a.normal[0]) < std::tuple(b.particle, std::round(b.overlap * 1e12), b.normal[0]);
  });
  return found;
}

// Ground with flat parts, ridges and valleys, and planes around it.
double ground_height(double x, double y) {
  const double hill = 0.03 * std::sin(25 * x) * std::cos(31 * y);
  return std::abs(hill) < 0.012 ? 0.0 : hill;
}
std::vector<Wall> landscape(int n) {
  return {terrain(0.2, n, ground_height), plane({-0.19, 0, 0}, Vec3::UnitX()), plane({0, 0.19, 0}, -Vec3::UnitY())};
}

TEST(WallContactList, FindsWhatTheRulesFindWhileTheListHolds) {
  // The list is made with every particle at one place; then all move by up to half the skin. Whatever shortcuts the list has taken,
  // the contacts must be those of the rules at the new places.
  std::mt19937 random(11);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::size_t contacts = 0, candidates = 0;
  for (const int n : {3, 8, 20, 50}) {
    for (const double skin : {0.02 * radius, 0.1 * radius, 0.5 * radius}) {
      std::vector<Body> bodies;
      while (bodies.size() < 4000) {
        const double x = 0.195 * uniform(random), y = 0.195 * uniform(random);
        bodies.push_back({{x, y, ground_height(x, y) + radius * (1 + 0.3 * uniform(random))}});
      }
      Drop drop(3, table_of<ContactModel<Linear, Frictionless, FreeRolling>, 3>(glass()), landscape(n), bodies, Vec3::Zero(), skin);
      // Only those that no wall has gone through, wherever they move.
      std::vector<std::uint32_t> kept;
      for (std::uint32_t i = 0; i < bodies.size(); ++i) {
        const auto found = contacts_at(drop.walls, bodies[i].at, radius + skin);
        if (std::all_of(found.begin(), found.end(), [&](const NearestPoint& c) { return c.distance > 0.06 * radius + skin; })) kept.push_back(i);
      }
      drop.particles.reorder(kept);
      drop.rebuild();
      for (auto& position : drop.particles.position) {
        const Vec3 way = Vec3(uniform(random), uniform(random), uniform(random)).normalized();
        position.add(0.5 * skin * std::cbrt(std::abs(uniform(random))) * way);
      }
      drop.evaluate(1e-5);
      std::vector<Found> expected;
      for (std::uint32_t i = 0; i < drop.particles.size(); ++i) {
        const auto rules = contacts_at(drop.walls, drop.at(i));
        std::vector<double> weights(rules.size());
        share_creases(radius, rules, weights);
        Vec3 force = Vec3::Zero();
        for (std::size_t c = 0; c < rules.size(); ++c) {
          expected.push_back({i, radius - rules[c].distance, rules[c].normal});
          force += weights[c] * glass().stiffness * expected.back().overlap * rules[c].normal;
        }
        EXPECT_LT((drop.force(i) - force).norm(), 1e-12 * glass().stiffness * radius) << n << " " << skin;
      }
      std::sort(expected.begin(), expected.end(), [](const Found& a, const Found& b) {
        return std::tuple(a.particle, std::round(a.overlap * 1e12), a.normal[0]) < std::tuple(b.particle, std::round(b.overlap * 1e12), b.normal[0]);
      });
      const auto found = present(drop.contacts);
      ASSERT_EQ(found.size(), expected.size()) << n << " " << skin;
      for (std::size_t c = 0; c < found.size(); ++c) {
        ASSERT_EQ(found[c].particle, expected[c].particle);
        EXPECT_NEAR(found[c].overlap, expected[c].overlap, 1e-16);
        EXPECT_LT((found[c].normal - expected[c].normal).norm(), 1e-12);
      }
      contacts += found.size();
      candidates += drop.contacts.candidate_count();
    }
  }
  EXPECT_GT(contacts, 10000u);
  EXPECT_GT(candidates, contacts);
}

// The whole trajectory must not depend on when lists are made, nor on the order of the particles.
template <class Model>
void expect_lists_do_not_matter() {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<Body> bodies;
  for (int k = 0; k < 40; ++k) {
    const Vec3 at(0.08 * uniform(random), 0.08 * uniform(random), radius + 0.017 + 0.004 * uniform(random));
    bodies.push_back({at, {0.5 * uniform(random), 0.5 * uniform(random), -0.5}, {20 * uniform(random), 20 * uniform(random), 20 * uniform(random)}});
  }
  const auto ground = terrain(0.2, 12, [](double x, double y) { return 0.015 * std::sin(25 * x) * std::cos(31 * y); });
  const auto drop = [&] {
    return Drop(3, table_of<Model, 3>(glass()), {ground, plane({-0.08, 0, 0}, Vec3::UnitX())}, bodies, {0, 0, -9.81}, 0.3 * radius, false);
  };
  Drop rare = drop(), often = drop();
  const double step = 1e-5;
  std::size_t most = 0;
  for (int window = 0; window < 300; ++window) {
    rare.advance(10, step);
    often.advance(10, step);
    most = std::max(most, rare.contacts.contact_count());
    often.reverse();
    for (std::uint32_t i = 0; i < bodies.size(); ++i) {
      const auto j = static_cast<std::size_t>(std::find(often.particles.id.begin(), often.particles.id.end(), rare.particles.id[i]) - often.particles.id.begin());
      ASSERT_LT((rare.at(i) - often.at(j)).norm(), 1e-13) << window << " " << i;  // round-off of 3000 steps
      ASSERT_LT((rare.particles.spin_of(i) - often.particles.spin_of(j)).norm(), 1e-8);
    }
  }
  EXPECT_GT(most, 8u);
  EXPECT_LT(rare.rebuilds, 300);
}
TEST(WallContactList, HistoriesSurviveNewListsAndSorting) { expect_lists_do_not_matter<HertzMindlin>(); }
TEST(WallContactList, HistoriesOfOtherSizesDoTheSame) { expect_lists_do_not_matter<RollingSlider>(); }

TEST(WallContactList, HistoryIsCarriedAcrossEdges) {
  // Stuck on an inclined floor of facets and pushed over their edges while friction holds: the spring must not be lost, whatever
  // the list does. The reference is the plane.
  for (const double skin : {0.02 * radius, 0.2 * radius}) {
    const Vec3 gravity(0.3 * 9.81, 0.2 * 9.81, -9.81);
    const std::vector<Body> ball{{{-0.05, -0.04, 0.999 * radius}, {0.3, 0.2, 0}, {-0.2 / radius, 0.3 / radius, 0}}};  // it rolls
    Drop on_plane(3, table_of<HertzMindlin, 3>(glass()), {plane(Vec3::Zero(), Vec3::UnitZ())}, ball, gravity, skin);
    Drop on_mesh(3, table_of<HertzMindlin, 3>(glass()), {triangulated_floor(0.2, 40)}, ball, gravity, skin);
    const double step = 2e-5;
    double sticking = 0;
    for (int window = 0; window < 200; ++window) {
      const auto expected = on_plane.advance(50, step), load = on_mesh.advance(50, step);
      EXPECT_LT((on_plane.at() - on_mesh.at()).norm(), 1e-13);
      EXPECT_LT((expected.walls[0].force - load.walls[0].force).norm(), 1e-10 * ball_mass * 9.81);
      const Vec3 torque = load.walls[0].torque + on_mesh.walls.reference(0).cross(load.walls[0].force);  // the plane's is about the origin
      EXPECT_LT((expected.walls[0].torque - torque).norm(), 1e-10 * ball_mass * 9.81);
      sticking += load.walls[0].force.head<2>().norm();
    }
    EXPECT_GT(sticking / 200, 0.05 * ball_mass * 9.81);  // there was something to lose
    EXPECT_GT(on_mesh.at()[0], 0.03);  // across eight columns of triangles
  }
}

TEST(WallContactList, HistoryOfAnEndedContactIsForgotten) {
  // A ball that sticks, is lifted, and put back at rest: no tangential force is left.
  Drop drop(3, table_of<HertzMindlin, 3>(glass()), {triangulated_floor(0.2, 7)}, {{{0.01, 0.02, 0.99 * radius}, {0.1, 0, 0}}});
  drop.rebuild();
  for (int k = 0; k < 10; ++k) drop.evaluate(1e-5);
  drop.particles.velocity[0].set(Vec3::Zero());
  drop.evaluate(1e-5);
  EXPECT_LT(drop.force()[0], -1e-4 * drop.force()[2]);
  drop.particles.position[0].z = 1.01 * radius;
  drop.evaluate(1e-5);
  EXPECT_EQ(drop.contacts.contact_count(), 0u);
  drop.particles.position[0].z = 0.99 * radius;
  drop.evaluate(1e-5);
  EXPECT_EQ(drop.force()[0], 0);
  EXPECT_GT(drop.force()[2], 0);
}

TEST(MovingWall, ForcesDependOnRelativeMotionOnly) {
  // A throw on a floor that rests, and the same seen from a frame that moves past at a constant velocity.
  const Vec3 drift(0.7, -0.4, 0.3);
  for (const auto& floor : {plane(Vec3::Zero(), Vec3::UnitZ()), triangulated_floor(0.2, 9), glued(triangulated_floor(0.2, 9), 0.008)}) {
    const Vec3 at(-0.04, 0.03, radius + 0.0061), velocity(0.4, 0.2, -0.3), spin(3, 1, -2);
    Drop still(3, table_of<RollingHertzMindlin, 3>(glass()), {floor}, {{at, velocity, spin}}, {0, 0, -9.81});
    Drop passing(3, table_of<RollingHertzMindlin, 3>(glass()), {moved(floor, Motion::translation(drift))}, {{at, velocity + drift, spin}}, {0, 0, -9.81});
    const double step = 2e-5;
    for (int window = 0; window < 50; ++window) {
      const auto expected = still.advance(50, step), load = passing.advance(50, step);
      EXPECT_LT((passing.at() - drift * passing.time - still.at()).norm(), 1e-12);
      EXPECT_LT((load.walls[0].force - expected.walls[0].force).norm(), 1e-8 * ball_mass * 9.81);
      EXPECT_LT((load.walls[0].torque - expected.walls[0].torque).norm(), 1e-8 * ball_mass * 9.81);
      EXPECT_NEAR(load.walls[0].power, -load.walls[0].force.dot(drift), 1e-14);
      for (std::size_t v = 0; v < expected.vertex_force[0].size(); ++v)
        EXPECT_LT((load.vertex_force[0][v] - expected.vertex_force[0][v]).norm(), 1e-8 * ball_mass * 9.81);
    }
    EXPECT_GT(passing.walls.travel_since_mark(), 0);
  }
}

TEST(TurningWall, BallThatTurnsWithTheTableFeelsNoFriction) {
  for (const auto& table : {plane(Vec3::Zero(), Vec3::UnitZ()), triangulated_floor(0.2, 9)}) {
    const double speed = 2, arm = 0.06;
    Drop drop(3, table_of<RollingHertzMindlin, 3>(glass()), {moved(table, Motion::rotation(Vec3::Zero(), Vec3::UnitZ(), speed))},
              {{{arm, 0, radius - 1e-5}, {0, arm * speed, 0}, {0, 0, speed}}, {{0, arm, radius - 1e-5}}});
    drop.start(1e-5);
    EXPECT_LT(drop.force(0).head<2>().norm(), 1e-15 * drop.force(0)[2]);
    EXPECT_LT(drop.torque(0).norm(), 1e-15 * radius * drop.force(0)[2]);
    EXPECT_LT(drop.force(1)[0], -0.01 * drop.force(1)[2]);  // the one at rest is dragged along
    EXPECT_LT(std::abs(drop.force(1)[1]), 1e-15 * drop.force(1)[2]);
    EXPECT_GT(drop.torque(1)[2], 0);  // and turned
  }
}

TEST(TurningWall, BallOnATurntableRollsInCircles) {
  // A ball that rolls without slip on a table turning at Ω has dv/dt = κ Ω × v, κ = I/(I + m a²) with the arm a of the contact: 2/7 for a
  // rigid sphere (Earnshaw 1844). The friction that this takes strains the tangential spring by m κ Ω v / k_t = 2e-7 m, and the first
  // steps set it swinging by as much; the circle has a radius of 0.044 m.
  const auto pair = glass();
  const double overlap = std::pow(ball_mass * 9.81 / (4.0 / 3.0 * pair.modulus * std::sqrt(radius)), 2.0 / 3.0), arm = radius - overlap;
  const double speed = 4, kappa = 0.4 * radius * radius / (0.4 * radius * radius + arm * arm);
  for (const auto& table : {plane(Vec3::Zero(), Vec3::UnitZ()), triangulated_floor(0.2, 15)}) {
    const Vec3 at(0.02, -0.03, arm), velocity(0.05, 0, 0), slip = velocity - speed * Vec3::UnitZ().cross(at);
    Drop drop(3, table_of<HertzMindlin, 3>(pair), {moved(table, Motion::rotation(Vec3::Zero(), Vec3::UnitZ(), speed))},
              {{at, velocity, Vec3(-slip[1], slip[0], 0) / arm}}, {0, 0, -9.81}, 0.2 * radius);
    const Vec3 centre = at + Vec3::UnitZ().cross(velocity) / (kappa * speed);
    double worst = 0;
    for (int window = 0; window < 200; ++window) {
      drop.advance(100, 5e-5);
      const Vec3 expected = centre + Eigen::AngleAxisd(kappa * speed * drop.time, Vec3::UnitZ()) * (at - centre);
      worst = std::max(worst, (drop.at() - expected).norm());
    }
    EXPECT_LT(worst, 1e-6);
    EXPECT_GT((drop.at() - at).norm(), 0.04);
    EXPECT_GT(drop.rebuilds, 50);
  }
}

TEST(MovingWall, AnElasticBallGainsTheWorkOfTheWall) {
  // Hit by a wall that moves at V, a ball at rest leaves at 2 V; the wall has done 2 m V² of work and given 2 m V of momentum.
  auto pair = glass(0);
  pair.friction = 0;
  const double speed = 0.4;
  for (const auto& wall : {plane(Vec3::Zero(), Vec3::UnitZ()), triangulated_floor(0.1, 3)}) {
    Drop drop(3, table_of<HertzMindlin, 3>(pair), {moved(wall, Motion::translation({0, 0, speed}))}, {{{0.01, 0.02, radius + 1e-3}}});
    const double step = 1e-6;
    const auto load = drop.advance(8000, step);
    EXPECT_NEAR(drop.particles.velocity_of(0)[2], 2 * speed, 2 * speed * 1e-6);  // of the integrator, second order in the step
    // The trapezoidal sum of forces is what velocity Verlet adds to the momentum.
    EXPECT_NEAR(-load.walls[0].force[2] * drop.time, ball_mass * drop.particles.velocity_of(0)[2], 1e-12 * ball_mass * speed);
    EXPECT_NEAR(load.walls[0].power * drop.time, -load.walls[0].force[2] * drop.time * speed, 1e-12 * ball_mass * speed * speed);
    EXPECT_EQ(drop.contacts.contact_count(), 0u);
  }
}

TEST(Servo, PressesABallWithItsForce) {
  Servo servo;
  servo.direction = -Vec3::UnitZ();
  servo.force = 0.3;
  servo.mass = 0.05;
  servo.damping = 5;
  servo.max_speed = 0.1;
  Drop drop(3, table_of<HertzMindlin, 3>(glass(1)),
            {plane(Vec3::Zero(), Vec3::UnitZ()), moved(plane({0, 0, 2 * radius + 1e-4}, -Vec3::UnitZ()), Motion::servo(servo))},
            {{{0, 0, 0.9999 * radius}}});
  drop.advance(60000, 1e-5);
  EXPECT_NEAR(drop.contacts.resultants()[1].force[2], servo.force, 1e-9 * servo.force);
  EXPECT_NEAR(drop.contacts.resultants()[0].force[2], -servo.force, 1e-9 * servo.force);
}

TEST(WallContactList, NamesTheBallThatGoesThroughAWall) {
  for (const auto& wall : {plane(Vec3::Zero(), Vec3::UnitZ()), triangulated_floor(0.1, 3), glued(triangulated_floor(0.1, 3), 0.01)}) {
    const double height = wall.glued_diameter > 0 ? 0.005 : 0;
    const auto at = wall.glued_diameter > 0 ? wall.mesh.points[5] : Vec3(0.01, 0.02, 0);
    Drop drop(3, table_of<HertzMindlin, 3>(glass()), {wall}, {{at + Vec3(0, 0, height + 0.03 * radius)}});
    drop.rebuild();
    try {
      drop.contacts.update(drop.walls, drop.particles, 0.25);
      FAIL();
    } catch (const std::runtime_error& error) {
      EXPECT_NE(std::string(error.what()).find("particle 0 is pushed through wall " + wall.name + " at t = 0.25 s"), std::string::npos) << error.what();
    }
  }
}

}  // namespace
}  // namespace acopla::dem::test::walls
