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

}  // namespace
}  // namespace acopla::fem::test
