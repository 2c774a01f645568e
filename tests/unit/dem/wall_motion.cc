// Motions of walls against closed forms.
#include <gtest/gtest.h>

#include "geometry/couple.h"
#include "wall_scenes.h"

namespace acopla::dem::test::walls {
namespace {

const Vec3 slanted = Vec3(1, 2, -0.5).normalized();

std::vector<std::pair<const char*, Motion>> all_motions() {
  return {{"translation", Motion::translation({1, -2, 0.5}, {0.3, 1.7, 0.4})},
          {"short translation", Motion::translation({1, -2, 0.5}, {0.3, 0.5, 0.4})},  // stops while it still speeds up
          {"rotation", Motion::rotation({0.1, 0.2, 0.3}, slanted, 7, {0.2, 1.5, 0.5})},
          {"vibration", Motion::vibration({0.01, 0, 0.02}, 3, 0.7, {0.2, 1.2, 0.4})},
          {"turning vibration", Motion::turning_vibration({0.1, 0.2, 0.3}, slanted, 0.2, 3, 0.7, {0.2, 1.2, 0.4})},
          {"smooth path", Motion::path({0.1, 0.5, 0.7, 1.6}, {{0, 0, 0}, {1, 0, 0}, {1, 2, 0}, {0, 1, 3}}, {0, 1, 4, 2}, {1, 0, 0}, slanted, true)},
          {"linear path", Motion::path({0.1, 0.5, 0.7, 1.6}, {{0, 0, 0}, {1, 0, 0}, {1, 2, 0}, {0, 1, 3}}, {0, 1, 4, 2}, {1, 0, 0}, slanted, false)}};
}

TEST(WallMotion, VelocityIsTheDerivativeOfThePlace) {
  // Central differences over 2e-5 s. Away from the few kinks (ends of ramps, nodes of a path) the error is h²/6 of the third derivative,
  // 18.8³ · 0.2 at most, and the round-off of values up to 10 over h: both below 1e-6 by far.
  constexpr double h = 1e-5;
  for (const auto& [name, motion] : all_motions())
    for (double time = 0.0037; time < 2.3; time += 0.0113) {
      const auto before = motion.at(time - h), now = motion.at(time), after = motion.at(time + h);
      EXPECT_LT(((after.displacement - before.displacement) / (2 * h) - now.velocity).norm(), 1e-7) << name << " at " << time;
      EXPECT_NEAR((after.angle - before.angle) / (2 * h), now.rate, 1e-7) << name << " at " << time;
    }
}

TEST(WallMotion, RampedRotationTurnsByItsClosedForm) {
  // Two seconds at 30 rpm between two ramps of half a second: each ramp turns half of what full speed would.
  const double speed = 30 * 2 * M_PI / 60;
  const auto motion = Motion::rotation(Vec3::Zero(), Vec3::UnitZ(), speed, {1, 3.5, 0.5});
  EXPECT_EQ(motion.at(1).angle, 0);
  EXPECT_NEAR(motion.at(1.5).angle, 0.25 * speed, 1e-15);
  EXPECT_EQ(motion.at(2).rate, speed);
  EXPECT_NEAR(motion.at(3.5).angle, 2.25 * speed, 1e-14);
  EXPECT_NEAR(motion.at(4).angle, 2.5 * speed, 1e-14);
  EXPECT_EQ(motion.at(4).rate, 0);
  EXPECT_NEAR(motion.at(100).angle, 2.5 * speed, 1e-13);
}

TEST(WallMotion, VibrationIsASine) {
  const Vec3 amplitude(0.002, 0, -0.001);
  const auto motion = Motion::vibration(amplitude, 50, M_PI / 3);
  for (double time = 0; time < 0.1; time += 0.00137) {
    const double phase = 2 * M_PI * 50 * time + M_PI / 3;
    EXPECT_LT((motion.at(time).displacement - std::sin(phase) * amplitude).norm(), 1e-17);
    EXPECT_LT((motion.at(time).velocity - 2 * M_PI * 50 * std::cos(phase) * amplitude).norm(), 1e-15);
  }
  // It waits where it will begin.
  const auto later = Motion::vibration(amplitude, 50, M_PI / 3, {1});
  EXPECT_EQ(later.at(0.5).displacement, later.at(1).displacement);
  EXPECT_EQ(later.at(0.5).velocity, Vec3::Zero());
}

TEST(WallMotion, SmoothPathMeetsItsNodesWithoutAKink) {
  const std::vector<double> times{0, 1, 1.5, 3};
  const std::vector<Vec3> nodes{{0, 0, 0}, {1, 1, 0}, {2, 0, 1}, {0, 0, 0}};
  const auto motion = Motion::path(times, nodes, {}, Vec3::Zero(), Vec3::UnitZ(), true);
  for (std::size_t k = 0; k < times.size(); ++k) {
    EXPECT_LT((motion.at(times[k]).displacement - nodes[k]).norm(), 1e-15);
    // The acceleration is below 40 m/s², so the speeds on both sides of a node differ by less than 40 · 2e-9.
    EXPECT_LT((motion.at(times[k] - 1e-9).velocity - motion.at(times[k] + 1e-9).velocity).norm(), 1e-7);
  }
  EXPECT_LT(motion.at(1e-9).velocity.norm(), 1e-7);
  EXPECT_LT(motion.at(3 - 1e-9).velocity.norm(), 1e-7);
  EXPECT_EQ(motion.at(5).velocity, Vec3::Zero());
  EXPECT_EQ(motion.at(5).displacement, nodes.back());
}

TEST(WallMotion, SmoothPathFollowsAParabolaBetweenInnerNodes) {
  // Slopes from the parabola through three nodes and a cubic between them reproduce a parabola.
  const std::vector<double> times{0, 0.3, 1, 1.2, 2};
  std::vector<double> angles;
  const auto parabola = [](double t) { return 2 - 3 * t + 4 * t * t; };
  for (const double t : times) angles.push_back(parabola(t));
  const auto motion = Motion::path(times, {}, angles, Vec3::Zero(), Vec3::UnitZ(), true);
  for (double t = 0.3; t < 1.2; t += 0.01) {
    EXPECT_NEAR(motion.at(t).angle, parabola(t), 2e-15);
    EXPECT_NEAR(motion.at(t).rate, -3 + 8 * t, 2e-14);
  }
}

// A servo that presses on a spring of stiffness k behind the wall.
WallResultant spring(const WallSet& set, double stiffness) {
  WallResultant resultant;
  resultant.force = -stiffness * set.servo_travel(0) * slanted;
  return resultant;
}

TEST(Servo, WithAGainApproachesItsForceAsAGeometricSeries) {
  Servo servo;
  servo.direction = slanted;
  servo.force = 20;
  servo.gain = 2e-3;
  servo.max_speed = 10;
  WallSet set({moved(plane(Vec3::Zero(), slanted), Motion::servo(servo))});
  constexpr double stiffness = 1e4, step = 1e-3;
  double factor = 1;
  for (int k = 1; k <= 300; ++k) {
    set.begin_forces();
    set.add_forces(std::array{spring(set, stiffness)});
    set.move(k * step, step);
    factor *= 1 - servo.gain * stiffness * step;
    EXPECT_NEAR(set.servo_travel(0), servo.force / stiffness * (1 - factor), 1e-15 * servo.force);
    NearestPoint contact;
    ASSERT_TRUE(set.touches(0, set.servo_travel(0) * slanted, radius, contact));
    EXPECT_NEAR(contact.distance, 0, 1e-17);
    EXPECT_LT((set.velocity_at(contact) - set.servo_speed(0) * slanted).norm(), 1e-17);
  }
  EXPECT_NEAR(spring(set, stiffness).force.norm(), servo.force, servo.force * 2.4e-3);  // (1 − 0.02)³⁰⁰ = 2.33e-3
}

TEST(Servo, PlateComesToRestAtItsForceAndKeepsItsSpeedLimit) {
  Servo servo;
  servo.direction = slanted;
  servo.force = 20;
  servo.mass = 0.5;
  servo.damping = 60;
  servo.max_speed = 0.02;
  servo.start = 0.1;
  WallSet set({moved(plane(Vec3::Zero(), slanted), Motion::servo(servo))});
  constexpr double stiffness = 1e4, step = 1e-4;
  double fastest = 0;
  for (int k = 1; k <= 20000; ++k) {
    set.begin_forces();
    set.add_forces(std::array{spring(set, stiffness)});
    set.move(k * step, step);
    fastest = std::max(fastest, std::abs(set.servo_speed(0)));
    if (k * step <= 0.1) {
      EXPECT_EQ(set.servo_travel(0), 0);
    }
  }
  EXPECT_EQ(fastest, servo.max_speed);
  EXPECT_NEAR(spring(set, stiffness).force.norm(), servo.force, 1e-12 * servo.force);  // damped for 114 of its time constants
}

// A crooked facet mesh and a turn of it.
TEST(RigidWall, ContactsTurnWithTheWall) {
  const auto hills = terrain(0.1, 6, [](double x, double y) { return 0.02 * std::sin(60 * x) * std::cos(50 * y); });
  const WallSet still({hills});
  const Vec3 centre(0.3, -0.2, 0.1);
  WallSet turning({moved(hills, Motion::rotation(centre, slanted, 3))});
  turning.move(0.6, 0.1);
  const Eigen::Matrix3d rotation = Eigen::AngleAxisd(1.8, slanted).toRotationMatrix();
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::size_t contacts = 0;
  for (int k = 0; k < 3000; ++k) {
    const Vec3 at(0.1 * uniform(random), 0.1 * uniform(random), 0.03 * uniform(random)), turned = centre + rotation * (at - centre);
    const auto here = contacts_at(still, at), there = contacts_at(turning, turned);
    ASSERT_EQ(here.size(), there.size());
    for (std::size_t c = 0; c < here.size(); ++c) {
      ++contacts;
      EXPECT_NEAR(here[c].distance, there[c].distance, 1e-15);
      EXPECT_LT((there[c].point - (centre + rotation * (here[c].point - centre))).norm(), 1e-15);
      EXPECT_LT((there[c].normal - rotation * here[c].normal).norm(), 5e-16 / here[c].distance);  // round-off of places over the distance
      const Vec3 velocity = (3 * slanted).cross(there[c].point - centre);
      EXPECT_LT((turning.velocity_at(there[c]) - velocity).norm(), 1e-15);
      EXPECT_LT((turning.spin_of(there[c].element) - 3 * slanted).norm(), 1e-15);
    }
  }
  EXPECT_GT(contacts, 500u);
}

TEST(RigidWall, PlaneMovesWithItsMotion) {
  WallSet set({moved(plane({0, 0, 0.1}, Vec3::UnitZ()), Motion::rotation({1, 0, 0}, Vec3::UnitY(), -1))});
  set.move(M_PI / 2, 1);  // the plane z = 0.1 becomes x = 1 − 0.1, looking to −x
  NearestPoint contact;
  ASSERT_TRUE(set.touches(0, {0.9 - 0.004, 0.3, 0.7}, radius, contact));
  EXPECT_NEAR(contact.distance, 0.004, 1e-15);
  EXPECT_LT((contact.normal + Vec3::UnitX()).norm(), 1e-15);
  EXPECT_LT((set.velocity_at(contact) - Vec3(0, -1, 0).cross(contact.point - Vec3(1, 0, 0))).norm(), 1e-15);
}

TEST(Travel, IsTheWayOfATranslationAndBoundsATurn) {
  const auto floor = triangulated_floor(0.1, 3);
  WallSet slides({moved(floor, Motion::translation({0.3, 0, 0.4}))});
  slides.move(2, 0.1);
  slides.mark(Vec3::Constant(-1), Vec3::Constant(1), radius);
  EXPECT_EQ(slides.travel_since_mark(), 0);
  slides.move(2.01, 0.01);
  EXPECT_NEAR(slides.travel_since_mark(), 0.005, 1e-15);

  WallSet turns({moved(floor, Motion::rotation({0.02, 0, 0}, slanted, 2))});
  turns.move(0.3, 0.1);
  const auto before = turns.positions(0);
  turns.mark(Vec3::Constant(-1), Vec3::Constant(1), radius);
  turns.move(0.31, 0.01);
  const auto after = turns.positions(0);
  double farthest = 0;
  for (std::size_t v = 0; v < before.size(); ++v) farthest = std::max(farthest, (after[v] - before[v]).norm());
  EXPECT_GE(turns.travel_since_mark(), farthest);
  EXPECT_LE(turns.travel_since_mark(), farthest + 0.02 * radius + 1e-6);  // the arc of 0.02 rad is longer by what a particle on top adds
}

// What an implicit coupling says: between a window's start and its assumed end a vertex follows the cubic of both.
TEST(PrescribedWall, FollowsACubicBetweenTwoInstants) {
  const auto floor = moved(triangulated_floor(0.1, 2), Motion::prescribed());
  WallSet set({floor});
  const auto& rest = floor.mesh.points;
  // A motion that is a cubic itself is followed exactly.
  const auto place = [](const Vec3& x, double t) { return Vec3(x[0] * t, 0.1 * t * t, 2 * t * t * t - x[1] * t * t); };
  const auto speed = [](const Vec3& x, double t) { return Vec3(x[0], 0.2 * t, 6 * t * t - 2 * x[1] * t); };
  const double start = 0.2, length = 0.1;
  std::vector<Vec3> u0, v0, u1, v1;
  for (const auto& x : rest) {
    u0.push_back(place(x, start)), v0.push_back(speed(x, start));
    u1.push_back(place(x, start + length)), v1.push_back(speed(x, start + length));
  }
  set.mark(Vec3::Constant(-1), Vec3::Constant(1), radius);
  set.prescribe(0, {u0, v0}, {u1, v1}, start, length);
  for (const double t : {0.2, 0.23, 0.25, 0.3}) {
    set.move(t, 0.01);
    const auto now = set.positions(0);
    double farthest = 0;
    for (std::size_t v = 0; v < rest.size(); ++v) {
      EXPECT_LT((now[v] - rest[v] - place(rest[v], t)).norm(), 1e-16);
      farthest = std::max(farthest, (now[v] - rest[v]).norm());
    }
    EXPECT_GE(set.travel_since_mark(), farthest * (1 - 1e-14));
  }
  set.mark(Vec3::Constant(-1), Vec3::Constant(1), radius);
  const auto contacts = contacts_at(set, rest[0] + place(rest[0], 0.3) + Vec3(1e-3, 1e-3, 0.002));
  ASSERT_FALSE(contacts.empty());
  for (const auto& contact : contacts) {
    Vec3 expected = Vec3::Zero();
    for (std::size_t n = 0; n < 3; ++n) expected += contact.weights[n] * speed(rest[set.facet(contact.element)[n]], 0.3);
    EXPECT_LT((set.velocity_at(contact) - expected).norm(), 1e-14);
  }
}

// What a coupled solver says: a bent and stretched floor.
TEST(PrescribedWall, StartsAtWhatItReceivesAndMovesOnWithItsVelocity) {
  const auto floor = moved(triangulated_floor(0.1, 4), Motion::prescribed());
  WallSet set({floor});
  const auto& rest = floor.mesh.points;
  std::vector<Vec3> displacement, velocity;
  for (const auto& x : rest) {
    displacement.emplace_back(0.1 * x[1], 0, 0.3 * x[0]);
    velocity.emplace_back(0, x[0], 2 * x[1] * x[0]);
  }
  set.move(1, 0.5);
  set.mark(Vec3::Constant(-1), Vec3::Constant(1), radius);
  set.prescribe(0, displacement, velocity, 1);
  set.move(1.01, 0.01);
  const auto now = set.positions(0);
  double farthest = 0;
  for (std::size_t v = 0; v < rest.size(); ++v) {
    const Vec3 expected = rest[v] + displacement[v] + 0.01 * velocity[v];
    EXPECT_LT((now[v] - expected).norm(), 1e-17);
    farthest = std::max(farthest, (expected - rest[v]).norm());
  }
  EXPECT_GE(set.travel_since_mark(), farthest);
  EXPECT_LE(set.travel_since_mark(), farthest + 2e-3);  // jump and way are added though they do not point the same way

  set.mark(Vec3::Constant(-1), Vec3::Constant(1), radius);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-0.09, 0.09);
  std::size_t contacts = 0;
  for (int k = 0; k < 300; ++k) {
    const double x = uniform(random), y = uniform(random);
    for (const auto& contact : contacts_at(set, {x, y, 0.3 * x + 0.003})) {
      ++contacts;
      Vec3 point = Vec3::Zero(), expected = Vec3::Zero();
      for (std::size_t n = 0; n < 3; ++n) {
        const auto v = set.facet(contact.element)[n];
        point += contact.weights[n] * now[v];
        expected += contact.weights[n] * velocity[v];
      }
      EXPECT_LT((contact.point - point).norm(), 1e-15);
      EXPECT_LT((set.velocity_at(contact) - expected).norm(), 1e-15);
    }
  }
  EXPECT_GT(contacts, 250u);
}

TEST(PrescribedWall, SpinDoesTheWorkOfACouple) {
  // Σ f · v over the vertices of the forces that carry a couple (geometry/couple.h) is couple · spin.
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto vector = [&] { return Vec3(uniform(random), uniform(random), uniform(random)); };
  for (int k = 0; k < 200; ++k) {
    const std::vector<Vec3> corners{vector(), vector(), vector()}, velocity{vector(), vector(), vector()};
    WallSet set({moved(mesh(corners, {{0, 1, 2}}), Motion::prescribed())});
    set.prescribe(0, std::vector<Vec3>(3, Vec3::Zero()), velocity, 0);
    const Vec3 couple = vector();
    std::array<Vec3, 3> forces;
    if (!geometry::couple_forces(corners, couple, forces, 1e-3)) continue;
    double work = 0, scale = 0;
    for (std::size_t n = 0; n < 3; ++n) {
      work += forces[n].dot(velocity[n]);
      scale += forces[n].norm() * velocity[n].norm();
    }
    EXPECT_NEAR(couple.dot(set.spin_of(0)), work, 1e-12 * scale);
  }
  const std::vector<Vec3> corners{{0.1, 0.2, 0}, {0.4, -0.3, 0}}, velocity{{1, 2, 0}, {-3, 1, 0}};
  WallSet set({moved(line(corners), Motion::prescribed())});
  set.prescribe(0, std::vector<Vec3>(2, Vec3::Zero()), velocity, 0);
  std::array<Vec3, 2> forces;
  ASSERT_TRUE(geometry::couple_forces(corners, {0, 0, 7}, forces));
  EXPECT_NEAR(7 * set.spin_of(0)[2], forces[0].dot(velocity[0]) + forces[1].dot(velocity[1]), 1e-13 * 7);
}

}  // namespace
}  // namespace acopla::dem::test::walls
