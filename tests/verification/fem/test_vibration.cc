// Natural frequencies and vibration of a cantilever.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "fem/dynamics.h"
#include "fem/elasticity.h"
#include "fem/grid.h"
#include "fem/model.h"
#include "fem/modes.h"
#include "fem/statics.h"

namespace acopla::fem::test {
namespace {

using std::numbers::pi;

/// Steel strip of 1 m × 0.05 m in plane stress, clamped at x = 0.
class ACantilever : public testing::Test {
 protected:
  static Grid strip(double height, int along, int across) {
    return {.name = "strip",
            .dimension = 2,
            .cells = {along, across, 1},
            .corner =
                [=](const GridIndex& i) {
                  return Vec3(static_cast<double>(i[0]) / along, height * i[1] / across, 0);
                },
            .sides = side_name};
  }
  static constexpr double young = 2.1e11, density = 7850;
  /// Euler–Bernoulli: β² / (2 π L²) sqrt(E I / (ρ A)) [Hz].
  static double euler(double beta, double height) {
    return beta * beta / (2 * pi) * std::sqrt(young * height * height / 12 / density);
  }
};

// β L = 1.87510, 4.69409, 7.85476. Euler's beam has no shear and no rotary inertia; with both
// (Timoshenko) a mode of a free wave is lower by ½ (β h)²/12 (1 + E/(k G)) = 4.3e-4 β², h = 0.05.
// Clamps and free ends change that by some tenths: 4e-3 in the third mode.
TEST_F(ACantilever, HasTheFrequenciesOfABeam) {
  const double height = 0.05;
  const Mesh mesh(build(strip(height, 40, 2)), 2);
  const Material steel{young, 0.3, density};
  const Formulation plane{.plane = Formulation::Plane::stress};
  const auto K = assemble_stiffness(mesh, steel, plane);
  const auto M = assemble_mass(mesh, steel, plane, K.pattern());
  Fixed fixed(mesh.unknowns(), 0);
  hold(mesh.boundary("x0"), {true, true, true}, fixed, 2);
  const auto modes = natural_modes(mesh, K, M, fixed, 4, {});
  ASSERT_EQ(modes.size(), 4u);
  EXPECT_NEAR(euler(1.87510, height), 41.776, 5e-3);
  std::size_t m = 0;
  for (const double beta : {1.87510, 4.69409, 7.85476}) {
    const double exact = euler(beta, height);
    EXPECT_NEAR(modes[m].frequency / exact, 1 - 4.3e-4 * beta * beta, 4e-3) << beta;
    ++m;
  }
  // The fourth is the first along the beam: sqrt(E/ρ) / (4 L), but for the clamp that holds
  // Poisson's contraction.
  EXPECT_NEAR(modes[3].frequency, std::sqrt(young / density) / 4,
              0.01 * std::sqrt(young / density) / 4);

  // Modes are orthogonal in both matrices, and satisfy K φ = ω² M φ at free unknowns.
  for (std::size_t i = 0; i < modes.size(); ++i) {
    Vector K_phi, M_phi;
    K.multiply(modes[i].shape, K_phi);
    M.multiply(modes[i].shape, M_phi);
    const double square = std::pow(2 * pi * modes[i].frequency, 2);
    for (std::size_t j = 0; j < modes.size(); ++j) {
      EXPECT_NEAR(modes[j].shape.dot(M_phi), i == j, 1e-8);
      EXPECT_NEAR(modes[j].shape.dot(K_phi), i == j ? square : 0, 1e-8 * square);
    }
  }

  // Vibration in the first mode keeps to it: u(t) = φ cos ω̄ t with the period of the trapezoidal
  // rule.
  Supports supports(mesh);
  supports.hold("clamp", mesh, nodes_of(mesh.boundary("x0")), {true, true, true});
  const Loads none(mesh);
  Dynamics dynamics(mesh, K, M, {}, supports, none, {}, {});
  Motion motion{modes[0].shape, mesh.zero(), {}, {}, 0};
  const double step = 1 / modes[0].frequency / 50, phase = 2 * std::atan(pi / 50);
  for (int n = 1; n <= 100; ++n) dynamics.advance(motion, mesh.zero(), step, 1);
  EXPECT_LT((motion.displacement - std::cos(100 * phase) * modes[0].shape).norm(),
            1e-7 * modes[0].shape.norm());
}

TEST_F(ACantilever, HasNoMoreModesThanItHasUnknowns) {
  const Mesh mesh(build(strip(0.1, 2, 1)), 1);
  const Material steel{young, 0.3, density};
  const auto K = assemble_stiffness(mesh, steel);
  const auto M = assemble_mass(mesh, steel, {}, K.pattern());
  Fixed fixed(mesh.unknowns(), 0);
  hold(mesh.boundary("x0"), {true, true, true}, fixed, 2);
  EXPECT_THROW(natural_modes(mesh, K, M, fixed, 5, {}), std::invalid_argument);
}

// Slenderness 1 : 1000, one cell of second order across: P L³/(3 E I) of plane stress to 1e-3 in
// spite of a condition of 1e12.
TEST_F(ACantilever, MayBeAThousandTimesLongerThanHigh) {
  const double height = 1e-3, force = 1e-3;
  const Mesh mesh(build(strip(height, 100, 1)), 2);
  const Material steel{young, 0.0, {}};
  const Formulation plane{.plane = Formulation::Plane::stress};
  Fixed fixed(mesh.unknowns(), 0);
  hold(mesh.boundary("x0"), {true, true, true}, fixed, 2);
  Statics statics(mesh, steel, fixed, {}, plane);
  statics.prepare();
  Load load(io::Table::from_text("", "case.toml"));
  load.kind = Load::Kind::force;
  load.value = Vec3(0, -force, 0);
  load.part.groups = {"x1"};
  const auto solution = statics.solve(nodal_forces(load, mesh, plane));
  const double exact = -force / (3 * young * height * height * height / 12);
  EXPECT_NEAR(value_at(solution.displacement, mesh.nearest_node({1, 0, 0}), 2)[1], exact,
              1e-3 * std::abs(exact));
}

// Stiffness and density that jump by 1e6: a soft, light half on a hard, heavy one. Bars in series
// to the error of 1e-9 that the condition of some 1e9 leaves.
TEST_F(ACantilever, MayHaveContrastsOfAMillion) {
  const Mesh mesh(build(strip(0.1, 10, 1)), 2);
  std::vector<std::uint16_t> half(mesh.cells());
  for (std::size_t c = 0; c < half.size(); ++c) half[c] = mesh.positions(c).row(0).mean() > 0.5;
  const Materials materials({{1e12, 0, 1e4}, {1e6, 0, 1e-2}}, half);
  Fixed fixed(mesh.unknowns(), 0);
  hold(mesh.boundary("x0"), {true, true, true}, fixed, 2);
  Statics statics(mesh, materials, fixed, {});
  statics.prepare();
  Load load(io::Table::from_text("", "case.toml"));
  load.kind = Load::Kind::traction;
  load.value = Vec3(1e3, 0, 0);
  load.part.groups = {"x1"};
  const auto u = statics.solve(nodal_forces(load, mesh, {})).displacement;
  const double exact = 1e3 * (0.5 / 1e6 + 0.5 / 1e12);
  EXPECT_NEAR(value_at(u, mesh.nearest_node({1, 0.05, 0}), 2)[0], exact, 1e-9 * exact);
}

// Waves along a bar of two halves, clamped at the hard one, of impedances Z = sqrt(E ρ) and speeds c = sqrt(E/ρ): the lowest frequency
// solves Z₁ cos a cos b = Z₂ sin a sin b, a = ω L/(2 c₁), b = ω L/(2 c₂). Found by bisection below the first quarter wave of either half.
// 20 cells of second order a half: (k h)⁴/1440 < 1e-6 of a quarter wave. In motion the energy stays what it was.
TEST_F(ACantilever, MayHaveContrastsOfAMillionInMotion) {
  const Mesh mesh(build(strip(0.1, 40, 1)), 2);
  std::vector<std::uint16_t> half(mesh.cells());
  for (std::size_t c = 0; c < half.size(); ++c) half[c] = mesh.positions(c).row(0).mean() > 0.5;
  const Material hard{1e12, 0, 1e4};
  for (const auto& soft : {Material{1e12, 0, 1e-2}, Material{1e6, 0, 1e4}, Material{1e6, 0, 1e-2}}) {
    const Materials materials({hard, soft}, half);
    const auto impedance = [](const Material& m) { return std::sqrt(m.young * *m.density); };
    const auto speed = [](const Material& m) { return std::sqrt(m.young / *m.density); };
    double low = 0, high = pi * std::min(speed(hard), speed(soft));
    for (int k = 0; k < 200; ++k) {
      const double w = 0.5 * (low + high), a = 0.5 * w / speed(hard), b = 0.5 * w / speed(soft);
      (impedance(hard) * std::cos(a) * std::cos(b) > impedance(soft) * std::sin(a) * std::sin(b) ? low : high) = w;
    }
    const auto K = assemble_stiffness(mesh, materials);
    const auto M = assemble_mass(mesh, materials, {}, K.pattern());
    Supports supports(mesh);
    supports.hold("clamp", mesh, nodes_of(mesh.boundary("x0")), {true, true, true});
    std::vector<std::uint32_t> all(mesh.nodes());
    for (std::uint32_t n = 0; n < all.size(); ++n) all[n] = n;
    supports.hold("sides", mesh, all, {false, true, true});
    const auto modes = natural_modes(mesh, K, M, supports.fixed(), 1, {});
    EXPECT_NEAR(2 * pi * modes[0].frequency, low, 1e-6 * low);

    const Loads none(mesh);
    Dynamics dynamics(mesh, K, M, {}, supports, none, {}, {});
    Motion motion{modes[0].shape, mesh.zero(), {}, {}, 0};
    motion.displacement.tail(20).array() += motion.displacement.lpNorm<Eigen::Infinity>();  // and some of the other modes
    supports.place(0, motion.displacement);
    const double start = dynamics.energy(motion).strain;
    for (int n = 0; n < 1000; ++n) dynamics.advance(motion, mesh.zero(), 0.05 / modes[0].frequency, 1);
    const auto now = dynamics.energy(motion);
    EXPECT_NEAR(now.kinetic + now.strain, start, 1e-8 * start);
  }
}

// Steps of a thousand periods of the lowest mode, let go from a bend: the trapezoidal rule keeps the energy of any step, and the
// generalised-α method with ρ∞ = 0.5 damps what it cannot resolve, after velocities that overshoot by ω Δt in its first steps (Erlicher et al. 2002),
// and is below the start's energy after 30. Displacements stay those of the bend, the shape of most
// displacement at its energy but for 10 %.
TEST_F(ACantilever, MayStepOverAThousandPeriods) {
  const double height = 0.05;
  const Mesh mesh(build(strip(height, 20, 1)), 2);
  const Material steel{young, 0.3, density};
  const Formulation plane{.plane = Formulation::Plane::stress};
  const auto K = assemble_stiffness(mesh, steel, plane);
  const auto M = assemble_mass(mesh, steel, plane, K.pattern());
  Supports supports(mesh);
  supports.hold("clamp", mesh, nodes_of(mesh.boundary("x0")), {true, true, true});
  Statics statics(mesh, K, supports.fixed(), {});
  statics.prepare();
  Vector end = mesh.zero();
  add_at(end, mesh.nearest_node({1, height, 0}), 2, Vec3(0, -1e4, 0));
  const auto bent = statics.solve(end).displacement;
  const Loads none(mesh);
  const double step = 1000 / euler(1.87510, height);
  const int settled = 30;
  for (const auto& scheme : {Scheme{}, Scheme::generalised_alpha(0.5)}) {
    Dynamics dynamics(mesh, K, M, {}, supports, none, scheme, {});
    Motion motion{bent, mesh.zero(), {}, {}, 0};
    const double start = dynamics.energy(motion).strain;
    for (int n = 0; n < 300; ++n) {
      dynamics.advance(motion, mesh.zero(), step, 1);
      const auto now = dynamics.energy(motion);
      if (scheme.average_acceleration()) {
        EXPECT_NEAR(now.kinetic + now.strain, start, 1e-7 * start) << n;  // of the matrix the mass is 1e-7, and its round-off 1e-9
      } else if (n >= settled) {
        EXPECT_LT(now.kinetic + now.strain, start) << n;
      }
      if (n >= (scheme.average_acceleration() ? 0 : settled)) {
        EXPECT_LT(largest_length(motion.displacement, 2), 1.1 * largest_length(bent, 2)) << n;
      }
    }
  }
}

// ν = 0.4999 in bending: cells of first order, plain, bear 8 % of the deflection they have with B-bar, which is Timoshenko's of plane
// strain within 2 %.
TEST_F(ACantilever, OfRubberBendsWithBBar) {
  const double height = 0.1, nu = 0.4999;
  const Mesh mesh(build(strip(height, 80, 8)), 1);
  Fixed fixed(mesh.unknowns(), 0);
  hold(mesh.boundary("x0"), {true, true, true}, fixed, 2);
  Load load(io::Table::from_text("", "case.toml"));
  load.kind = Load::Kind::force;
  load.value = Vec3(0, -1, 0);
  load.part.groups = {"x1"};
  const auto tip = [&](Formulation::Locking locking) {
    const Formulation plane{.locking = locking};
    Statics statics(mesh, Material{1e6, nu, {}}, fixed, {}, plane);
    statics.prepare();
    return -value_at(statics.solve(nodal_forces(load, mesh, plane)).displacement, mesh.nearest_node({1, height / 2, 0}), 2)[1];
  };
  const double stiff = 1e6 / (1 - nu * nu), inertia = std::pow(height, 3) / 12;
  const double exact = 1 / (3 * stiff * inertia) + 1 / (5. / 6 * 1e6 / (2 * (1 + nu)) * height);
  EXPECT_NEAR(tip(Formulation::Locking::b_bar), exact, 0.02 * exact);
  EXPECT_LT(tip(Formulation::Locking::untreated), 0.5 * exact);
}

}  // namespace
}  // namespace acopla::fem::test
