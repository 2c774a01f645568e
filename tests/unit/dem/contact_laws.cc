// Contact laws as functions: their closed forms. What every law must do by itself is in law_properties.cc.
#include <gtest/gtest.h>

#include "dem/contact/restitution.h"
#include "tests/unit/dem/all_models.h"
#include "tests/unit/dem/law_paths.h"

namespace acopla::dem::test {
namespace {

constexpr double radius = 0.005, mass = 0.005;

template <int dimension>
Kinematics<double, dimension> contact(double overlap, const Vec3& slip = Vec3::Zero(), double step = 1e-5) {
  Kinematics<double, dimension> k{};
  k.overlap = overlap;
  k.reduced_radius = radius;
  k.reduced_mass = mass;
  k.reduced_inertia = 1e-7;
  k.rolling_inertia = 3e-7;
  k.normal = vector_of<dimension>(dimension == 3 ? Vec3::UnitZ() : Vec3::UnitY());
  k.slip = vector_of<Kinematics<double, dimension>::turns>(slip);
  k.step = step;
  return k;
}

using Sphere = Kinematics<double, 3>;
using Disc = Kinematics<double, 2>;

// Force of a law without history.
template <class Law, class K>
double force(const K& k, const typename Law::Parameters& p) {
  typename Law::template History<K> history{};
  return Law::force(k, p, history);
}

TEST(Hertz, ForceStiffnessAndEnergyAreHertzs) {
  // F = 4/3 Y* sqrt(R*) δ^(3/2), its derivative and its integral; round-off of three roots.
  const double modulus = 7e6, overlap = 1e-4, hertz = 4.0 / 3 * modulus * std::sqrt(radius);
  const auto k = contact<3>(overlap);
  EXPECT_NEAR(force<Hertz>(k, {modulus, 0}), hertz * std::pow(overlap, 1.5), 1e-15);
  EXPECT_NEAR(Hertz::stiffness(k, {modulus, 0}), 1.5 * hertz * std::sqrt(overlap), 1e-11);
  EXPECT_NEAR(Hertz::energy(k, {modulus, 0}, {}), 0.4 * hertz * std::pow(overlap, 2.5), 1e-19);
}

TEST(Hertz, DashpotIsAShareOfTheImpedance) {
  // Nasato's eq. 4 as corrected: F_d = 2 sqrt(5/6) β sqrt(S_n m*) v.
  auto k = contact<3>(1e-4);
  k.closing_speed = 0.2;
  const double still = force<Hertz>(contact<3>(1e-4), {7e6, 0.5}), moving = force<Hertz>(k, {7e6, 0.5});
  EXPECT_NEAR(moving - still, 0.5 * std::sqrt(2 * 7e6 * std::sqrt(radius * 1e-4) * mass) * 0.2, 1e-14);
}

TEST(Linear, ForceEnergyAndDashpotAreThoseOfASpring) {
  auto k = contact<2>(1e-4);
  k.closing_speed = 0.2;
  EXPECT_NEAR(force<Linear>(k, {1e4, 0.3}), 1 + 2 * 0.3 * std::sqrt(1e4 * mass) * 0.2, 1e-15);
  EXPECT_NEAR(Linear::energy(k, {1e4, 0.3}, {}), 0.5 * 1e4 * 1e-8, 1e-20);
}

TEST(NormalLaws, NeverPull) {
  auto k = contact<3>(1e-6);
  k.closing_speed = -10;
  EXPECT_EQ(force<Hertz>(k, {7e6, 0.5}), 0);
  EXPECT_EQ(force<Linear>(k, {1e4, 0.5}), 0);
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
  const double modulus = 7e6, heavy = 0.01, speed = 2;
  const double peak = std::pow(15 * heavy * speed * speed / (16 * std::sqrt(radius) * modulus), 0.4);
  EXPECT_NEAR(stiffness_of_impact(modulus, radius, heavy, speed) * peak * peak / (heavy * speed * speed), 1, 1e-12);
}

TEST(LinearSpring, StiffnessOfAFallStopsItAtTheOverlapAsked) {
  // Gomes's eq. 2.90: m g h = ½ k δ².
  EXPECT_NEAR(0.5 * stiffness_of_fall(0.01, 9.81, 0.3, 2e-4) * 4e-8, 0.01 * 9.81 * 0.3, 1e-16);
}

// A tangential law at constant overlap: force after `steps` of that slip.
template <class Normal, class Tangential, class K>
Vec3 friction(const K& k, double normal_force, const typename Tangential::Parameters& p, const typename Normal::Parameters& normal, int steps,
              Vec3* elastic_part = nullptr) {
  typename Tangential::template History<K> history{};
  typename K::Turn force{}, before{};
  for (int n = 0; n < steps; ++n) force = Tangential::template force<Normal>(k, normal_force, p, normal, history, before);
  if (elastic_part) *elastic_part = eigen(history.force);
  return eigen(force);
}

TEST(Mindlin, SticksLikeASpringOfMindlinsStiffness) {
  // S_t = 8 G* sqrt(R* δ), eq. 8; the first step has the mean of that and nothing.
  const double stiffness = 8 * 2e6 * std::sqrt(radius * 1e-4);
  const auto k = contact<3>(1e-4, Vec3(1e-3, 2e-3, 0));
  EXPECT_LT((friction<Hertz, Mindlin>(k, 100, {2e6, 0, 0, 0.5}, {}, 7) + stiffness * 6.5 * k.step * Vec3(1e-3, 2e-3, 0)).norm(), 1e-15);
  const auto disc = contact<2>(1e-4, Vec3(1e-3, 0, 0));
  EXPECT_NEAR((friction<Hertz, Mindlin>(disc, 100, {2e6, 0, 0, 0.5}, {}, 7)[0]), -stiffness * 6.5 * k.step * 1e-3, 1e-15);
}

TEST(LinearSlider, SticksLikeASpringOfTheRatioAsked) {
  const auto k = contact<2>(1e-4, Vec3(1e-3, 0, 0));
  EXPECT_NEAR((friction<Linear, LinearSlider>(k, 100, {1 / 3.5, 0, 0.5}, {1e4, 0}, 7)[0]), -1e4 / 3.5 * 7 * k.step * 1e-3, 1e-15);
}

TEST(Friction, IsCoulombsAgainstTheSlipOnceItSlides) {
  // Long after the start: μ F_n, against the slip, with and without dashpot; the root of every step leaves round-off.
  const Vec3 slip(0.3, -0.4, 0), limit = -0.5 * 2 * slip.normalized();
  for (const double dashpot : {0.0, 0.7}) {
    EXPECT_LT((friction<Hertz, Mindlin>(contact<3>(1e-4, slip), 2, {2e6, 1, dashpot, 0.5}, {7e6, 0}, 10000) - limit).norm(), 1e-15);
    EXPECT_LT((friction<Linear, LinearSlider>(contact<3>(1e-4, slip), 2, {0.3, dashpot, 0.5}, {1e4, 0}, 10000) - limit).norm(), 1e-14);
  }
  EXPECT_EQ((friction<Linear, LinearSlider>(contact<2>(1e-4, Vec3(-0.5, 0, 0)), 2, {0.3, 0.7, 0.5}, {1e4, 0}, 10000)[0]), 1);
}

TEST(Friction, DashpotActsOnlyWhileItSticks) {
  // Gomes (2014), eq. 2.49–2.52: stuck, spring and dashpot add up; sliding, the dashpot is off and the spring holds all.
  const double impedance = std::sqrt(1e4 * mass);
  Vec3 elastic;
  const auto slow = contact<2>(1e-4, Vec3(1e-3, 0, 0));
  const double stuck = friction<Linear, LinearSlider>(slow, 2, {0.25, 0.3, 0.5}, {1e4, 0}, 1, &elastic)[0];
  EXPECT_NEAR(elastic[0], -0.25 * 1e4 * 1e-5 * 1e-3, 1e-18);
  EXPECT_NEAR(stuck - elastic[0], -0.3 * impedance * 1e-3, 1e-16);
  const double slides = friction<Linear, LinearSlider>(contact<2>(1e-4, Vec3(0.1, 0, 0)), 0.5, {0.25, 0.3, 0.5}, {1e4, 0}, 1000, &elastic)[0];
  EXPECT_EQ(slides, -0.25);
  EXPECT_EQ(elastic[0], -0.25);
}

TEST(Mindlin, GivesForceBackWhereItUnloads) {
  // The printed secant law (F = −S_t(δ) δ_t, eq. 7) does too, but takes none when the overlap grows: a loop creates energy.
  // Here the force falls as the stiffness does, and stays when it grows.
  Mindlin::History<Sphere> history{};
  Vector<double, 3> before;
  const Mindlin::Parameters p{2e6, 0, 0, 1e9};
  const auto at = [&](double overlap, double slip) {
    return Mindlin::force<Hertz>(contact<3>(overlap, Vec3(slip, 0, 0)), 1.0, p, {}, history, before).x;
  };
  at(4e-4, 1e-2);
  const double deep = at(4e-4, 0);
  EXPECT_NEAR(at(1e-4, 0) / deep, 0.5, 1e-15);  // sqrt(1/4)
  EXPECT_NEAR(at(4e-4, 0) / deep, 0.5, 1e-15);
}

TEST(Mindlin, StiffnessAndImpedanceGoTogether) {
  // sqrt(S_t m*) from the normal impedance and the ratio of moduli alone.
  PairProperties pair = soft_glass();
  const auto k = contact<3>(2e-4);
  const auto p = Mindlin::from(pair);
  const double direct = pair.hertz_damping * std::sqrt(Mindlin::stiffness<Hertz>(k, p, Hertz::from(pair)) * mass);
  EXPECT_NEAR(Mindlin::dashpot<Hertz>(k, p, Hertz::from(pair)) / direct, 1, 1e-15);
}

TEST(TangentialHistory, TurnsWithTheFrame) {
  // The pair turns rigidly by 90° about an axis in the tangent plane, out of it, or oblique; the force must have turned with it. The
  // direction is off by at most a quarter of the square of the tilt in each step, over N steps (π/2)²/(4 N) = 1.5e-4; about the normal
  // alone the error is of third order. The length is kept to the fourth order of the step's angle.
  for (const Vec3& axis : {Vec3(1, 0, 0), Vec3(0, 0, 1), Vec3(1, 2, 3).normalized()}) {
    constexpr int steps = 4000;
    const double angle = M_PI / 2 / steps;
    const Eigen::AngleAxisd turn(angle, axis);
    Vec3 normal = Vec3::UnitZ(), force(0.3, 0.4, 0);
    auto k = contact<3>(1e-4);
    for (int n = 0; n < steps; ++n) {
      normal = turn * normal;
      k.normal = vector_of<3>(normal.normalized());
      k.frame_spin = axis.dot(normal) * angle / k.step;
      force = eigen(turned_with_frame(vector_of<3>(force), k));
    }
    const Vec3 expected = Eigen::AngleAxisd(M_PI / 2, axis) * Vec3(0.3, 0.4, 0);
    const double tilt = axis.cross(Vec3::UnitZ()).norm();
    EXPECT_LT((force - expected).norm(), 0.5 * (tilt > 0 ? std::pow(M_PI / 2, 2) / 4 / steps : std::pow(M_PI / 2, 3) / 3 / steps / steps));
    EXPECT_NEAR(force.norm(), 0.5, 0.5 * steps * std::pow(angle, 4));
  }
}

TEST(ConstantTorque, OpposesTheRelativeSpinAndCannotReverseIt) {
  ConstantTorque::History<Sphere> none;
  double energy, work;
  const auto torque = [&](const Vec3& spin) {
    auto k = contact<3>(1e-4);
    k.relative_spin = vector_of<3>(spin);
    return eigen(ConstantTorque::torque(k, 10.0, {0, 1, 1, 0}, {0.05}, none, energy, work));
  };
  EXPECT_LT((torque({3, 4, 0}) + 0.05 * 10 * radius * Vec3(0.6, 0.8, 0)).norm(), 1e-18);  // μ_r F_n R
  EXPECT_NEAR(torque({3e-9, 4e-9, 0}).norm() * 1e-5 / 1e-7, ConstantTorque::share * 5e-9, 1e-24);
  EXPECT_EQ(torque({0, 0, 0}).norm(), 0);
}

// Torque of the elastic-plastic law after `steps` at constant overlap and spin.
template <class K>
Vec3 rolling(K k, const Vec3& spin, double normal_force, double shear_stiffness, const ElasticPlastic::Parameters& p, int steps) {
  k.relative_spin = vector_of<K::turns>(spin);
  ElasticPlastic::History<K> history{};
  double energy, work;
  typename K::Turn torque{};
  for (int n = 0; n < steps; ++n) torque = ElasticPlastic::torque(k, normal_force, {shear_stiffness, 1, 1, shear_stiffness}, p, history, energy, work);
  return eigen(torque);
}

TEST(ElasticPlastic, IsASpringOfKtRSquaredUntilItYields) {
  // k_r = factor k_t R² (eq. 2.100); the torque of 7 steps of spin. Yields at μ_r R F_n (eq. 2.70).
  const ElasticPlastic::Parameters p{0.05, 0, 1.2, 0};
  const double spring = 1.2 * 3000 * radius * radius;
  EXPECT_NEAR(rolling(contact<2>(1e-4), {0.7, 0, 0}, 10, 3000, p, 7)[0], -spring * 7e-5 * 0.7, 1e-18);
  EXPECT_LT((rolling(contact<3>(1e-4), {0.7, 0.2, 0}, 10, 3000, p, 7) + spring * 7e-5 * Vec3(0.7, 0.2, 0)).norm(), 1e-18);
  EXPECT_NEAR(rolling(contact<2>(1e-4), {0.7, 0, 0}, 10, 3000, p, 100000)[0], -0.05 * radius * 10, 1e-18);
  EXPECT_LT((rolling(contact<3>(1e-4), {3, -4, 0}, 10, 3000, p, 100000) + 0.05 * radius * 10 * Vec3(0.6, -0.8, 0)).norm(), 5e-17);
}

TEST(ElasticPlastic, DashpotIsOffOnceItYields) {
  // C_r = 2 η sqrt(I_r k_r) (eq. 2.101–2.103) beside the spring of one step; nothing beside the yield torque.
  const ElasticPlastic::Parameters p{0.05, 2 * 0.3, 1, 0};
  const double spring = 3000 * radius * radius, dash = 2 * 0.3 * std::sqrt(3e-7 * spring);
  EXPECT_NEAR(rolling(contact<2>(1e-4), {0.7, 0, 0}, 10, 3000, p, 1)[0], -spring * 1e-5 * 0.7 - dash * 0.7, 1e-18);
  EXPECT_NEAR(rolling(contact<2>(1e-4), {0.7, 0, 0}, 10, 3000, p, 100000)[0], -0.05 * radius * 10, 1e-18);
}

TEST(ElasticPlastic, TwistsAboutTheNormalByItsOwnSpring) {
  // Along the normal the spring and its yield are `twisting` times those of rolling; without it nothing resists.
  const ElasticPlastic::Parameters p{0.05, 0, 1.2, 0.4}, none{0.05, 0, 1.2, 0};
  const double spring = 0.4 * 1.2 * 3000 * radius * radius;
  EXPECT_LT((rolling(contact<3>(1e-4), {0, 0, 0.7}, 10, 3000, p, 7) + spring * 7e-5 * Vec3(0, 0, 0.7)).norm(), 1e-18);
  EXPECT_LT((rolling(contact<3>(1e-4), {0, 0, 0.7}, 10, 3000, p, 100000) + 0.4 * 0.05 * radius * 10 * Vec3(0, 0, 1)).norm(), 1e-17);
  EXPECT_EQ(rolling(contact<3>(1e-4), {0, 0, 0.7}, 10, 3000, none, 7).norm(), 0);
}

TEST(ElasticPlastic, SoftensWithTheContact) {
  // Regression: with Mindlin the rolling spring kept its torque while the contact unloaded, and a loop of overlap and rotation
  // created energy. Rolled deep and unloaded to a quarter of the overlap, spring and torque are half.
  using Model = ContactModel<Hertz, Mindlin, ElasticPlastic>;
  const auto p = Model::from(elastic_glass());
  Model::History<Sphere> history{};
  const auto at = [&](double overlap, const Vec3& spin) {
    auto k = contact<3>(overlap);
    k.relative_spin = vector_of<3>(spin);
    return eigen(Model::respond(k, p, history, nullptr).torque);
  };
  at(4e-4, {1, 2, 3});
  const Vec3 deep = at(4e-4, {0, 0, 0});
  EXPECT_GT(deep.norm(), 0);
  EXPECT_LT((at(1e-4, {0, 0, 0}) - 0.5 * deep).norm(), 1e-15 * deep.norm());
  EXPECT_LT((at(4e-4, {0, 0, 0}) - 0.5 * deep).norm(), 1e-15 * deep.norm());
}

TEST(WaltonBraun, LoadsUnloadsAndLoadsAgainAlongItsLines) {
  using granular::WaltonBraun;
  const WaltonBraun::Parameters p{1e4, 2.5e4, 0};
  WaltonBraun::History<Disc> history{};
  const auto at = [&](double overlap) { return WaltonBraun::force(contact<2>(overlap), p, history); };
  EXPECT_NEAR(at(1e-4), 1, 1e-15);          // k_1 δ
  EXPECT_NEAR(at(2e-4), 2, 1e-15);
  EXPECT_NEAR(at(1.6e-4), 1, 1e-14);        // k_2 (δ − δ_0), δ_0 = (1 − k_1/k_2) δ_max = 1.2e-4
  EXPECT_NEAR(WaltonBraun::energy(contact<2>(1.6e-4), p, history), 1 / 2.5e4 / 2, 1e-18);
  EXPECT_EQ(at(1.1e-4), 0);                 // in the dent
  EXPECT_NEAR(at(1.6e-4), 1, 1e-14);        // the same way back
  EXPECT_NEAR(at(3e-4), 3, 1e-14);
}

}  // namespace
}  // namespace acopla::dem::test
