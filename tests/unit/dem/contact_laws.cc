// Contact laws as functions: closed forms, Coulomb's limit, no energy from nothing, turning with the frame.
#include <gtest/gtest.h>

#include "dem/contact/model.h"
#include "dem/contact/restitution.h"

namespace acopla::dem {
namespace {

using Vector = Vector3<double>;

Kinematics<double> contact(double overlap, const Vector& slip = Vector(0, 0, 0), double step = 1e-5) {
  Kinematics<double> k{};
  k.overlap = overlap;
  k.reduced_radius = 0.005;
  k.reduced_mass = 0.005;
  k.reduced_inertia = 1e-7;
  k.normal = Vector(0, 0, 1);
  k.slip = slip;
  k.step = step;
  return k;
}

TEST(Hertz, StaticForceIsHertzs) {
  // F = 4/3 Y* sqrt(R*) δ^(3/2); round-off of three roots.
  const auto k = contact(1e-4);
  EXPECT_NEAR(Hertz::force(k, {7e6, 0}), 4.0 / 3 * 7e6 * std::sqrt(0.005) * std::pow(1e-4, 1.5), 1e-12);
}

TEST(Hertz, NeverPulls) {
  auto k = contact(1e-6);
  k.closing_speed = -10;
  EXPECT_EQ(Hertz::force(k, {7e6, 0.5}), 0);
}

TEST(Restitution, NoDashpotIsElasticAndMoreDashpotBouncesLess) {
  for (const auto& shape : {hertz_impact, linear_impact}) {
    EXPECT_NEAR(restitution_without_tension(shape, 0), 1, 1e-5);
    double before = 1;
    for (const double alpha : {0.1, 0.5, 1.0, 2.0, 5.0, 20.0}) {
      const double e = restitution_without_tension(shape, alpha);
      EXPECT_LT(e, before);
      EXPECT_GT(e, 0);
      before = e;
    }
  }
}

TEST(Restitution, LinearImpactWithoutTensionMatchesTheClosedForm) {
  // Schwager & Pöschel (2007), under-damped: e = exp(−ζ (π − atan(2 ζ sqrt(1−ζ²) / (2 ζ² − 1)) ...) ); here by the phase at
  // which k x + c v = 0: tan(ω t) = 2 ζ sqrt(1 − ζ²) / (2 ζ² − 1) in (0, π).
  for (const double zeta : {0.05, 0.2, 0.5, 0.8}) {
    const double root = std::sqrt(1 - zeta * zeta);
    const double phase = std::atan2(2 * zeta * root, 2 * zeta * zeta - 1);
    const double t = phase / root;
    const double speed = std::exp(-zeta * t) * (std::cos(phase) - zeta / root * std::sin(phase));
    EXPECT_NEAR(restitution_without_tension(linear_impact, 2 * zeta), -speed, 1e-6) << zeta;
  }
}

TEST(Restitution, InversionReturnsWhatWasAsked) {
  for (const auto& shape : {hertz_impact, linear_impact})
    for (const double e : {0.05, 0.3, 0.7, 0.95})
      EXPECT_NEAR(restitution_without_tension(shape, dashpot_for(shape, e)), e, 1e-8);
}

TEST(Restitution, PrintedFormulaIsOffAsTheErrataSay) {
  // Nasato's eq. 4 and 6 with F_n ≥ 0 return 0.397 for 0.3 and 0.253 for 0.1; three printed digits.
  const auto printed = [](double e) { return restitution_without_tension(hertz_impact, std::sqrt(5.0) * printed_damping_ratio(e)); };
  EXPECT_NEAR(printed(0.3), 0.397, 5e-4);
  EXPECT_NEAR(printed(0.1), 0.253, 5e-4);
}

TEST(Restitution, HertzDurationIsJohnsons) {
  // 2.94 δ_max / v in units where δ_max = (5/4)^(2/5); Johnson (1985), eq. 11.24, prints three digits.
  EXPECT_NEAR(impact_duration(hertz_impact) / std::pow(1.25, 0.4), 2.94, 5e-3);
  EXPECT_NEAR(impact_duration(linear_impact), M_PI, 1e-12);
}

TEST(LinearSpring, StiffnessOfImpactStoresTheHertzianEnergy) {
  // Eq. 12 as corrected: with that k the peak overlaps of both laws at speed V satisfy ½ k δ² = ½ m V² at
  // δ = (15 m V² / (16 sqrt(R) Y))^(2/5), Hertz's own peak.
  const double modulus = 7e6, radius = 0.005, mass = 0.01, speed = 2;
  const double peak = std::pow(15 * mass * speed * speed / (16 * std::sqrt(radius) * modulus), 0.4);
  EXPECT_NEAR(stiffness_of_impact(modulus, radius, mass, speed) * peak * peak / (mass * speed * speed), 1, 1e-12);
}

TEST(Mindlin, SmallSlipIsAStiffSpringAndLargeSlipIsCoulombs) {
  const Mindlin::Parameters p{2e6, 0, 0.5};
  SpringHistory<double> history{};
  const auto k = contact(1e-4, Vector(1e-3, 0, 0));
  const double stiffness = 8 * 2e6 * std::sqrt(0.005 * 1e-4);
  const auto small = Mindlin::force<Hertz>(k, 100.0, p, {}, history);
  EXPECT_NEAR(small.x, -stiffness * 1e-3 * k.step, 1e-12 * stiffness);
  Vector force;
  for (int step = 0; step < 100000; ++step) force = Mindlin::force<Hertz>(k, 2.0, p, {}, history);
  EXPECT_NEAR(force.vector().norm(), 1, 1e-12);
}

TEST(Mindlin, ClosedLoopsOfSlipAndOverlapNeverGiveEnergy) {
  // The body goes round loops in (overlap, slip); the work the contact does on it must not be positive. The printed secant
  // law (F = −S_t(δ) δ_t) fails this when it slips deep and comes back shallow.
  const Mindlin::Parameters p{2e6, 0, 1e9};  // sticks: nothing but the spring
  for (const double sense : {1.0, -1.0}) {
    SpringHistory<double> history{};
    double tangential_work = 0, last = 0;
    constexpr int steps = 20000;
    const double step = 1e-6;
    for (int n = 0; n < 5 * steps; ++n) {
      const double phase = sense * 2 * M_PI * n / steps;
      const double speed = 1e-5 * 2 * M_PI / (steps * step) * std::cos(phase) * sense;
      const auto k = contact(1e-4 * (1.5 - std::cos(phase + 0.8)), Vector(speed, 0, 0), step);
      const double force = Mindlin::force<Hertz>(k, 1.0, p, {}, history).x;
      tangential_work += 0.5 * (force + last) * speed * step;
      last = force;
    }
    // Stored energy at most ½ S_t δ_t² is the scale; the loops end where they began.
    EXPECT_LT(tangential_work, 1e-3 * 0.5 * 8 * 2e6 * std::sqrt(0.005 * 2.5e-4) * 1e-10);
  }
}

TEST(TangentialHistory, TurnsWithTheFrame) {
  // The pair turns rigidly about an axis out of the tangent plane by 90°; the force must have turned with it. Per step the
  // direction is right to second order in the angle, so over N steps the error is of order (π/2)²/N = 6e-4 at worst.
  for (const Vec3& axis : {Vec3(1, 0, 0), Vec3(0, 0, 1), Vec3(1, 2, 3).normalized()}) {
    constexpr int steps = 4000;
    const double angle = M_PI / 2 / steps;
    const Eigen::AngleAxisd turn(angle, axis);
    Vec3 normal = Vec3::UnitZ(), force(0.3, 0.4, 0);
    auto k = contact(1e-4);
    for (int n = 0; n < steps; ++n) {
      normal = turn * normal;
      k.normal = Vector(normal.normalized());
      k.mean_spin = Vector(axis * (angle / k.step));
      force = turned_with_frame(Vector(force), k).vector();
    }
    const Vec3 expected = Eigen::AngleAxisd(M_PI / 2, axis) * Vec3(0.3, 0.4, 0);
    EXPECT_LT((force - expected).norm(), 5e-4) << axis.transpose();
    EXPECT_NEAR(force.norm(), 0.5, 1e-6);
  }
}

TEST(ConstantTorque, OpposesTheRelativeSpinAndCannotReverseIt) {
  auto k = contact(1e-4);
  k.relative_spin = Vector(3, 4, 0);
  const Vec3 torque = ConstantTorque::torque(k, 10.0, {0.05}).vector();
  EXPECT_NEAR((torque + 0.05 * 10 * k.reduced_radius * Vec3(0.6, 0.8, 0)).norm(), 0, 1e-15);
  k.relative_spin = Vector(3e-9, 4e-9, 0);
  const Vec3 gentle = ConstantTorque::torque(k, 10.0, {0.05}).vector();
  EXPECT_LT(gentle.norm() * k.step / k.reduced_inertia, 5e-9);
  k.relative_spin = Vector(0, 0, 0);
  EXPECT_EQ(ConstantTorque::torque(k, 10.0, {0.05}).vector().norm(), 0);
}

template <class Model>
void expect_four_lanes_to_be_four_contacts() {
  // Four different contacts, one of them sliding, one unloading, one at rest, computed together and one by one.
  PairProperties pair;
  pair.modulus = 7e6;
  pair.shear_modulus = 2e6;
  pair.stiffness = 1e4;
  pair.stiffness_ratio = 3;
  pair.hertz_damping = 0.4;
  pair.damping_ratio = 0.2;
  pair.friction = 0.3;
  pair.rolling_friction = 0.05;
  const auto p = Model::from(pair);
  Kinematics<double> one[4];
  SpringHistory<double> history[4];
  Kinematics<DoublePack> all{};
  SpringHistory<DoublePack> histories{};
  for (int lane = 0; lane < 4; ++lane) {
    auto& k = one[lane];
    k = contact(1e-4 * (lane + 1), lane == 3 ? Vector(0, 0, 0) : Vector(0.1 * lane, 1e-3, 0));
    k.closing_speed = 0.3 * (lane - 1);
    k.mean_spin = Vector(1, lane, 2);
    k.relative_spin = lane == 3 ? Vector(0, 0, 0) : Vector(lane, 1, 0);
    history[lane] = {lane == 3 ? Vector(0, 0, 0) : Vector(0.01 * lane, -0.02, 0), lane == 1 ? 1e6 : 0.0};
    const auto put = [lane](DoublePack& to, double value) { to.v[lane] = value; };
    const auto put3 = [&](Vector3<DoublePack>& to, const Vector& value) {
      put(to.x, value.x);
      put(to.y, value.y);
      put(to.z, value.z);
    };
    put(all.overlap, k.overlap);
    put(all.closing_speed, k.closing_speed);
    put(all.reduced_radius, k.reduced_radius);
    put(all.reduced_mass, k.reduced_mass);
    put(all.reduced_inertia, k.reduced_inertia);
    put3(all.normal, k.normal);
    put3(all.slip, k.slip);
    put3(all.mean_spin, k.mean_spin);
    put3(all.relative_spin, k.relative_spin);
    put3(histories.force, history[lane].force);
    put(histories.stiffness, history[lane].stiffness);
    all.step = k.step;
  }
  const auto together = Model::respond(all, p, histories);
  for (int lane = 0; lane < 4; ++lane) {
    const auto alone = Model::respond(one[lane], p, history[lane]);
    // The same operations in the same order, up to fused multiply-adds.
    const auto near = [lane](const Vector3<DoublePack>& a, const Vector& b) {
      EXPECT_NEAR((Vec3(a.x[lane], a.y[lane], a.z[lane]) - b.vector()).norm(), 0, 1e-13 * (1 + b.vector().norm())) << lane;
    };
    near(together.force, alone.force);
    if constexpr (Model::has_rolling) near(together.torque, alone.torque);
    if constexpr (Model::has_history) near(histories.force, history[lane].force);
  }
}

TEST(FourLanes, AreFourContacts) {
  expect_four_lanes_to_be_four_contacts<ContactModel<Hertz, Mindlin, ConstantTorque>>();
  expect_four_lanes_to_be_four_contacts<ContactModel<Linear, LinearSlider, ConstantTorque>>();
  expect_four_lanes_to_be_four_contacts<ContactModel<Hertz, Frictionless, FreeRolling>>();
}

}  // namespace
}  // namespace acopla::dem
