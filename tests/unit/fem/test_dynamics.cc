// Structures in motion. The oscillator of most tests is one cell of a bar of ν = 0, held at x = 0
// and free along x alone at its other end, whose four nodes move together: k = E A / L, m = ρ A L /
// 3, and ρ A L / 6 couples the two ends.
#include "fem/dynamics.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <complex>
#include <numbers>

#include "fem/elasticity.h"
#include "gmsh_writer.h"

namespace acopla::fem::test {
namespace {

using std::numbers::pi;

constexpr double length = 2, area = 1, density = 1500, young = 6e4;
constexpr double mass = density * area * length / 3, stiffness = young * area / length;
const double omega = std::sqrt(stiffness / mass), period = 2 * pi / omega;

/// A body and what moves it.
struct Body {
  explicit Body(const Mesh& mesh_, double young_modulus = young)
      : mesh(mesh_),
        material{young_modulus, 0.0, density},
        K(assemble_stiffness(mesh, material)),
        M(assemble_mass(mesh, material, {}, K.pattern())),
        supports(mesh),
        loads(mesh) {}
  Dynamics dynamics(const Scheme& scheme = {}, const Rayleigh& damping = {},
                    const SolverOptions& options = {}) const {
    return {mesh, K, M, damping, supports, loads, scheme, options};
  }
  Motion rest() const { return {mesh.zero(), mesh.zero(), {}, {}, 0}; }

  const Mesh& mesh;
  Material material;
  BlockMatrix K;
  MassMatrix M;
  Supports supports;
  Loads loads;
};

class AnOscillator : public testing::Test {
 protected:
  AnOscillator() { hold(body_); }
  void hold(Body& body) const {
    std::vector<std::uint32_t> all(mesh_.nodes());
    for (std::uint32_t n = 0; n < all.size(); ++n) all[n] = n;
    body.supports.hold("sides", mesh_, all, {false, true, true});
    body.supports.hold("base", mesh_, nodes_of(mesh_.boundary("x0")), {true, false, false});
  }
  /// A displacement, velocity or force shared by the end's nodes.
  Vector at_end(double value) const {
    Vector result = mesh_.zero();
    for (const auto node : end_) result[3 * Eigen::Index{node}] = value;
    return result;
  }
  double end_of(const Vector& nodal) const { return nodal[3 * Eigen::Index{end_[0]}]; }
  Motion displaced(double u) const {
    auto motion = body_.rest();
    motion.displacement = at_end(u);
    return motion;
  }
  /// End displacement at `time` of free vibration from u = 1, in `steps` windows.
  double vibrate(const Scheme& scheme, double time, int steps, const Rayleigh& damping = {}) const {
    auto dynamics = body_.dynamics(scheme, damping);
    auto motion = displaced(1);
    const Vector none = mesh_.zero();
    for (int n = 0; n < steps; ++n) dynamics.advance(motion, none, time / steps, 1);
    return end_of(motion.displacement);
  }

  Mesh mesh_{write_block("cell", {.size = {length, 1, 1}, .cells = {1, 1, 1}}), 1};
  Body body_{mesh_};
  std::vector<std::uint32_t> end_ = nodes_of(mesh_.boundary("x1"));
};

// What a sudden force on one node accelerates, against the inverse of the whole matrix. Only nodes of the same cells are asked, which on a regular
// mesh of either degree is right within seven percent, and never too little.
TEST(MassMatrix, KnowsWhatASuddenForceOnANodeMoves) {
  for (const unsigned degree : {1u, 2u}) {
    const Mesh mesh(write_block("sudden", {.size = {4, 2, 2}, .cells = {4, 2, 2}}), degree);
    const Body body(mesh);
    const auto nodes = static_cast<Eigen::Index>(mesh.nodes());
    Eigen::MatrixXd whole(nodes, nodes);
    Vector unit = mesh.zero(), column;
    for (Eigen::Index n = 0; n < nodes; ++n) {
      unit[3 * n] = 1;
      body.M.multiply(unit, column);
      unit[3 * n] = 0;
      for (Eigen::Index m = 0; m < nodes; ++m) whole(m, n) = column[3 * m];
    }
    const Eigen::MatrixXd inverse = whole.inverse();
    for (Eigen::Index n = 0; n < nodes; ++n) {
      const double exact = 1 / inverse(n, n), found = body.M.sudden(static_cast<std::uint32_t>(n));
      EXPECT_GE(found, exact * (1 - 1e-10));
      EXPECT_LE(found, exact * 1.07) << degree << " " << n;
    }
  }
}

// The trapezoidal rule turns the phase by ω̄ Δt = 2 atan(ω Δt / 2) a step. The period of three steps
// is read from cos ω̄ Δt = (u₀ + u₂) / (2 u₁); the elongations are those of Hughes (1987), to the
// figures printed.
TEST_F(AnOscillator, HasThePeriodElongationOfTheTrapezoidalRule) {
  for (const auto& [fraction, elongation, last_digit] : {std::tuple{0.01, 3.289e-4, 1e-7},
                                                         {0.05, 8.171e-3, 1e-6},
                                                         {0.1, 3.2075e-2, 1e-6},
                                                         {0.2, 0.12003, 1e-5}}) {
    auto dynamics = body_.dynamics();
    auto motion = displaced(1);
    const Vector none = mesh_.zero();
    double u[3] = {1, 0, 0};
    for (int n = 1; n < 3; ++n) {
      dynamics.advance(motion, none, fraction * period, 1);
      u[n] = end_of(motion.displacement);
    }
    const double phase = std::acos((u[0] + u[2]) / (2 * u[1]));
    EXPECT_NEAR(2 * pi * fraction / phase - 1, elongation, 0.5 * last_digit);
    EXPECT_NEAR(phase, 2 * std::atan(pi * fraction), 1e-12);
    EXPECT_NEAR(u[2], std::cos(2 * phase), 1e-13);
  }
}

// The rule conserves energy exactly; twenty thousand steps add their round-off as a random walk.
TEST_F(AnOscillator, KeepsItsEnergyForAThousandPeriods) {
  auto dynamics = body_.dynamics();
  auto motion = displaced(1e-3);
  const auto start = dynamics.energy(motion);
  EXPECT_NEAR(start.strain, 0.5 * stiffness * 1e-6, 1e-12 * start.strain);
  const Vector none = mesh_.zero();
  double worst = 0;
  for (int n = 0; n < 20000; ++n) {
    dynamics.advance(motion, none, period / 20, 1);
    const auto now = dynamics.energy(motion);
    worst = std::max(worst, std::abs(now.kinetic + now.strain - start.strain) / start.strain);
  }
  EXPECT_LT(worst, 1e-11);
  EXPECT_EQ(dynamics.factorisations(), 1u);
}

// Steps of a thousand periods: the amplitude neither grows nor, with γ = 1/2, decays.
TEST_F(AnOscillator, IsStableInStepsOfAThousandPeriods) {
  for (const auto& scheme : {Scheme{}, Scheme::newmark(0.5, 0.5), Scheme::newmark(0.3025, 0.6),
                             Scheme::generalised_alpha(1), Scheme::generalised_alpha(0.5),
                             Scheme::generalised_alpha(0)}) {
    auto dynamics = body_.dynamics(scheme);
    auto motion = displaced(1);
    const Vector none = mesh_.zero();
    double largest = 0;
    for (int n = 0; n < 500; ++n) {
      dynamics.advance(motion, none, 1000 * period, 1);
      // The generalised-α method overshoots once; what must not happen is growth.
      if (n > 3) largest = std::max(largest, std::abs(end_of(motion.displacement)));
    }
    EXPECT_LT(largest, 1 + 1e-6) << scheme.beta << " " << scheme.gamma;
  }
}

// Error of free vibration after 0.7 periods, steps halved: order 2 with γ = 1/2 and of the
// generalised-α method. After one period, where the phase does not matter, what is left is
// numerical damping: order 1 with γ > 1/2.
TEST_F(AnOscillator, ConvergesWithTheOrderOfItsScheme) {
  const auto order = [&](const Scheme& scheme, double time = 0.7 * period) {
    const double exact = std::cos(omega * time);
    return std::log2(
        std::abs((vibrate(scheme, time, 100) - exact) / (vibrate(scheme, time, 200) - exact)));
  };
  EXPECT_NEAR(order({}), 2, 0.02);
  EXPECT_NEAR(order(Scheme::newmark(0.3, 0.5)), 2, 0.02);
  EXPECT_NEAR(order(Scheme::generalised_alpha(0.8)), 2, 0.05);
  EXPECT_NEAR(order(Scheme::generalised_alpha(0)), 2, 0.1);
  EXPECT_NEAR(order(Scheme::newmark(0.3025, 0.6), period), 1, 0.1);
}

// Both are the same rule when no load changes: α_m = α_f = 1/2.
TEST_F(AnOscillator, MovesTheSameByGeneralisedAlphaWithoutDamping) {
  EXPECT_NEAR(vibrate(Scheme::generalised_alpha(1), 3 * period, 60), vibrate({}, 3 * period, 60),
              1e-11);
}

// Rayleigh: ξ = c_a / (2 ω) + c_b ω / 2. The rule's own decay a step is that of the trapezoidal
// rule applied to u'' + 2 ξ ω u' + ω² u = 0: eigenvalues (1 + z/2)/(1 − z/2) with z = Δt ω (−ξ ± i
// sqrt(1 − ξ²)), exact to round-off.
TEST_F(AnOscillator, DecaysAsRayleighDampingSays) {
  for (const auto& damping : {Rayleigh{0.4, 0}, Rayleigh{0, 0.01}, Rayleigh{0.3, 0.02}}) {
    const double xi = damping.mass / (2 * omega) + damping.stiffness * omega / 2,
                 step = period / 50;
    const std::complex<double> z = step * omega * std::complex(-xi, std::sqrt(1 - xi * xi)),
                               g = (1.0 + 0.5 * z) / (1.0 - 0.5 * z);
    // u_n = Re(c gⁿ) with u₀ = 1, u̇₀ = 0: c = 1 + i ξ / sqrt(1 − ξ²).
    const std::complex<double> c(1, -xi / std::sqrt(1 - xi * xi));
    EXPECT_NEAR(vibrate({}, 100 * step, 100, damping), (c * std::pow(g, 100)).real(), 1e-12);
    // and the decay of the equation itself but for ξ ω T (ω Δt)²/4, the next term of ln g
    EXPECT_NEAR(std::abs(std::pow(g, 50)), std::exp(-xi * omega * period),
                xi * 2 * pi * std::pow(2 * pi / 50, 2) / 4);
    EXPECT_NEAR(vibrate(Scheme::newmark(0.25, 0.5), 100 * step, 100, damping),
                vibrate(Scheme{0.25 + 1e-14, 0.5}, 100 * step, 100, damping), 1e-9);
  }
}

// Loads that vary, damping, several steps a window: what came in is there, or lost to damping.
TEST_F(AnOscillator, BalancesItsEnergyUnderLoadAndDamping) {
  body_.loads.add(at_end(300), Amplitude({{0, 0}, {0.3 * period, 1}, {2 * period, -0.5}}));
  auto dynamics = body_.dynamics({}, {0.3, 0.02});
  auto motion = displaced(0.1);
  double held = dynamics.energy(motion).strain, work = 0, lost = 0;
  const double start = held;
  for (int n = 0; n < 100; ++n) {
    Energy passed;
    dynamics.advance(motion, at_end(20 * std::sin(n)), period / 10, 3, &passed);
    held = passed.kinetic + passed.strain;
    work += passed.work;
    lost += passed.damping;
    EXPECT_GE(passed.damping, 0);
    EXPECT_NEAR(held, start + work - lost, 1e-11 * (start + std::abs(work) + lost));
  }
  EXPECT_GT(lost, 0);
}

// A window's steps are those of as many windows with the same mean force.
TEST_F(AnOscillator, TakesSeveralStepsAWindow) {
  for (const auto& scheme : {Scheme{}, Scheme::newmark(0.3, 0.5), Scheme::generalised_alpha(0.8)}) {
    auto one = body_.dynamics(scheme), many = body_.dynamics(scheme);
    auto a = displaced(1), b = displaced(1);
    const Vector force = at_end(40);
    one.advance(a, force, 0.4 * period, 4);
    for (int n = 0; n < 4; ++n) many.advance(b, force, 0.1 * period, 1);
    EXPECT_NEAR(end_of(a.displacement), end_of(b.displacement), 1e-13);
    EXPECT_NEAR(end_of(a.velocity), end_of(b.velocity), 1e-13 * omega);
  }
}

// The mean reaction balances loads and momentum: Σ (R̄ + F̄) T = Σ M (v₁ − v₀) + c_a Σ M (u₁ − u₀).
// The last is the drag that mass-proportional damping is; c_b leaves the momentum alone.
TEST_F(AnOscillator, ReactsWithWhatBalancesItsMomentum) {
  auto dynamics = body_.dynamics({}, {0.3, 0.02});
  auto motion = displaced(1);
  Vector before, after;
  for (int n = 0; n < 10; ++n) {
    body_.M.multiply(motion.velocity + 0.3 * motion.displacement, before);
    const auto reaction = dynamics.advance(motion, at_end(70), 0.05 * period, 2);
    body_.M.multiply(motion.velocity + 0.3 * motion.displacement, after);
    const double balance =
        (total(reaction, 3)[0] + 4 * 70) * 0.05 * period - (total(after, 3) - total(before, 3))[0];
    EXPECT_NEAR(balance, 0, 1e-12 * stiffness * period);
  }
}

/// The mean force over a window of a spring k_c between the end and a fixed partner, whose surface
/// moves with v from where the structure was at the window's start.
double mean_spring_force(double k_c, double u, double v, double step) {
  return -k_c * (u + 0.5 * step * v);
}

// Coupled to a fixed partner through a spring, in windows of one step, the staggered scheme is
// neutral up to ω_c Δt = 2 (ω_c² = k_c / m), whatever the structure's own stiffness, which is
// scaled through Young's modulus. The largest amplitude of the windows 1000 to 3000 is that of the
// first 1000 but for when it is sampled: 2e-3, so that a growth of 1e-6 a window would show. Where
// (u, v) is all the state there is, its matrix of a window says it exactly: determinant 1, complex
// eigenvalues.
TEST_F(AnOscillator, IsNeutralUnderTheMeanForceOfAWindow) {
  for (const double ratio : {1e-9, 1.0, 10.0})
    for (const double wc_dt : {0.02, 0.1, 0.5, 1.0, 1.5, 1.9})
      for (const auto& scheme : {Scheme{}, Scheme::newmark(0.3, 0.5), Scheme::generalised_alpha(1),
                                 Scheme::generalised_alpha(0.8), Scheme::generalised_alpha(0.5),
                                 Scheme::generalised_alpha(0)}) {
        const double k_c = stiffness;
        Body body(mesh_, ratio * young);
        hold(body);
        auto dynamics = body.dynamics(scheme);
        auto motion = displaced(1);
        const double step = wc_dt / std::sqrt(k_c / mass);
        if (scheme.average_acceleration()) {
          const auto window = [&](double u, double v) {
            auto state = displaced(u);
            state.velocity = at_end(v / step);
            dynamics.advance(state, at_end(mean_spring_force(k_c, u, v / step, step) / 4), step, 1);
            return std::pair(end_of(state.displacement), step * end_of(state.velocity));
          };
          const auto [a, b] = window(1, 0);
          const auto [c, d] = window(0, 1);
          EXPECT_NEAR(a * d - b * c, 1, 1e-12) << ratio << " " << wc_dt;
          EXPECT_LT(std::abs(a + d), 2) << ratio << " " << wc_dt;
        }
        double early = 0, late = 0;
        for (int n = 0; n < 3000; ++n) {
          const double force =
              mean_spring_force(k_c, end_of(motion.displacement), end_of(motion.velocity), step);
          dynamics.advance(motion, at_end(force / 4), step, 1);
          double& largest = n < 1000 ? early : late;
          largest = std::max(largest, std::abs(end_of(motion.displacement)));
        }
        EXPECT_LT(late, early * 1.002)
            << ratio << " " << wc_dt << " " << scheme.beta << " " << scheme.alpha_f;
      }
}

// The same with the force at the window's start, F(u_n), is unstable at every step: with K → 0 the
// step has the matrix
// [[1 − w²/2, 1], [−w², 1]], w = ω_c Δt, of determinant 1 + w²/2, so that the amplitude grows by
// sqrt(1 + w²/2) a window.
TEST_F(AnOscillator, GrowsUnderALaggedForceAtEveryStep) {
  for (const double wc_dt : {0.05, 0.2, 0.5, 1.0}) {
    const double k_c = stiffness, step = wc_dt / std::sqrt(k_c / mass);
    Body body(mesh_, 1e-9 * young);
    hold(body);
    auto dynamics = body.dynamics();
    auto motion = displaced(1);
    const auto size = [&] {  // energy of the oscillator that the lagged force makes of it
      const double u = end_of(motion.displacement), v = end_of(motion.velocity) * step;
      return std::sqrt(wc_dt * wc_dt * u * u - 0.5 * wc_dt * wc_dt * u * v + v * v);
    };
    const auto advance = [&] {
      dynamics.advance(motion, at_end(-k_c * end_of(motion.displacement) / 4), step, 1);
    };
    const double start = size();
    const int windows = 200;
    for (int n = 0; n < windows; ++n) advance();
    EXPECT_NEAR(std::pow(size() / start, 1.0 / windows), std::sqrt(1 + 0.5 * wc_dt * wc_dt), 1e-6);
  }
}

// Mean force, but put at the window's end with the acceleration carried on, as a plain Newmark step
// does it: with K → 0 its matrix has the determinant 1 + w²/4 + …, and it grows.
TEST(AnOscillatorWithACarriedAcceleration, GrowsUnderTheMeanForce) {
  for (const double w : {0.05, 0.2, 0.5, 1.0}) {
    double u = 1, v = 0, a = 0, early = 0, late = 0;
    for (int n = 0; n < 20000; ++n) {
      const double next = -w * w * (u + 0.5 * v);
      u += v + 0.25 * (a + next);
      v += 0.5 * (a + next);
      a = next;
      double& largest = n < 1000 ? early : late;
      largest = std::max(largest, std::abs(u));
    }
    EXPECT_GT(late, 1.5 * early) << w;
  }
}

// A base that starts with the acceleration b: the end lags by z, z'' + ω² z = −1.5 b (the coupling
// mass is half that of the end), so z_n = −1.5 b/ω² (1 − cos n ω̄ Δt) exactly, as the rule turns
// phases by ω̄ Δt. Other schemes: to their order.
TEST_F(AnOscillator, IsShakenByItsBase) {
  const double b = 0.7, step = period / 40;
  for (const auto& scheme : {Scheme{}, Scheme::newmark(0.3, 0.5), Scheme::generalised_alpha(0.9)}) {
    Body body(mesh_);
    std::vector<std::uint32_t> all(mesh_.nodes());
    for (std::uint32_t n = 0; n < all.size(); ++n) all[n] = n;
    body.supports.hold("sides", mesh_, all, {false, true, true});
    body.supports.move(
        "base", mesh_, nodes_of(mesh_.boundary("x0")), {true, false, false}, Vec3(1, 0, 0),
        {.amplitude = Amplitude({{0, 0}, {100 * period, 100 * period * b}}), .gives = MotionHistory::Gives::velocities});
    auto dynamics = body.dynamics(scheme);
    auto motion = body.rest();
    const Vector none = mesh_.zero();
    Energy passed;
    double held = 0, work = 0;
    for (int n = 1; n <= 60; ++n) {
      dynamics.advance(motion, none, step, 1, &passed);
      held = passed.kinetic + passed.strain;
      work += passed.support_work;
      const double phase =
          scheme.average_acceleration() ? 2 * std::atan(omega * step / 2) : omega * step;
      const double exact = -1.5 * b / (omega * omega) * (1 - std::cos(n * phase));
      const double tolerance = scheme.average_acceleration() ? 1e-12 : 0.03;
      EXPECT_NEAR(end_of(motion.displacement) - 0.5 * b * n * n * step * step, exact,
                  tolerance * 3 * b / (omega * omega));
      // The energy that is there came through the base.
      if (scheme.average_acceleration()) {
        EXPECT_NEAR(held, work, 1e-12 * (mass + held));
      }
    }
  }
}

TEST(NewmarksParameters, OfAnUnstablePairAreRefused) {
  const auto failure = [](double beta, double gamma) -> std::string {
    try {
      Scheme::newmark(beta, gamma);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(failure(0.25, 0.5), "");
  EXPECT_EQ(failure(0.3025, 0.6), "");
  EXPECT_NE(failure(1.0 / 6, 0.5).find("stable for short steps only"),
            std::string::npos);  // linear acceleration
  EXPECT_NE(failure(0.25, 0.6).find("beta = 0.25 below gamma / 2 = 0.3"), std::string::npos);
  EXPECT_NE(failure(0.25, 0.4).find("below 1/2"), std::string::npos);
}

class AFloatingBlock : public testing::Test {
 protected:
  Mesh mesh_{
      write_block(
          "block",
          {.size = {2, 1, 1},
           .move = [](const Vec3& p) { return Vec3(p + 0.02 * Vec3(p[1] * p[2], p[0], 0)); }}),
      2};
  Body body_{mesh_};
};

// Impulse is momentum: with no support Σ M Δv = F̄ Δt, and the body's mean moves with F/m. 1e-11:
// the residual of the solve.
TEST_F(AFloatingBlock, TakesUpTheImpulseOfALoad) {
  for (const auto kind : {SolverOptions::Kind::direct, SolverOptions::Kind::cg}) {
    auto dynamics = body_.dynamics({}, {}, {.kind = kind});
    auto motion = body_.rest();
    Vector force = mesh_.zero(), momentum;
    add_at(force, 17, 3, Vec3(3, -4, 5));
    add_at(force, 40, 3, Vec3(1, 1, 1));
    const double step = 1e-3;
    for (int n = 1; n <= 20; ++n) {
      dynamics.advance(motion, force, step, 1);
      body_.M.multiply(motion.velocity, momentum);
      EXPECT_LT((total(momentum, 3) - n * step * Vec3(4, -3, 6)).norm(), 1e-11 * n * step * 8);
    }
  }
}

// A rigid motion has no strain and keeps its velocity.
TEST_F(AFloatingBlock, FliesOnWithoutStrain) {
  auto dynamics = body_.dynamics();
  auto motion = body_.rest();
  for (std::size_t n = 0; n < mesh_.nodes(); ++n) add_at(motion.velocity, n, 3, Vec3(1, -2, 3));
  const Vector start = motion.velocity;
  for (int n = 0; n < 50; ++n) dynamics.advance(motion, mesh_.zero(), 0.01, 1);
  EXPECT_LT((motion.velocity - start).norm(), 1e-11 * start.norm());
  EXPECT_LT((motion.displacement - 0.5 * start).norm(), 1e-11 * start.norm());
  EXPECT_NEAR(body_.M.total(), density * mesh_.volume(), 1e-11 * density * mesh_.volume());
}

}  // namespace
}  // namespace acopla::fem::test
