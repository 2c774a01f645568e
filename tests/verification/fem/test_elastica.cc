// Large displacements: Euler's elastica, rigid rotations, and the tangent against differences.
#include <gtest/gtest.h>

#include <cmath>

#include "fem/finite_strain.h"
#include "fem/grid.h"
#include "fem/loads.h"
#include "fem/stress.h"

namespace acopla::fem::test {
namespace {

Grid strip(int dimension, double height, int along, int across) {
  return {.name = "strip",
          .dimension = dimension,
          .cells = {along, across, 1},
          .corner =
              [=](const GridIndex& i) {
                return Vec3(static_cast<double>(i[0]) / along, height * i[1] / across,
                            dimension == 3 ? height * i[2] : 0.0);
              },
          .sides = side_name};
}

// A cantilever under an end load that keeps its direction, v/L and u/L of the inextensible elastica
// for P L²/(E I) = 1, 2, 5, 10 (Mattiasson 1981). Slenderness 1:100: shear and stretch are
// below 1e-3 of the answer.
TEST(AnElastica, BendsAsEulersCurve) {
  const double height = 0.01, young = 1e9, inertia = height * height * height / 12;
  const Mesh mesh(build(strip(2, height, 40, 1)), 2);
  const Materials rubber = Material{young, 0.0, {}};
  const Formulation plane{.plane = Formulation::Plane::stress};
  Fixed fixed(mesh.unknowns(), 0);
  hold(mesh.boundary("x0"), {true, true, true}, fixed, 2);
  Load end(io::Table::from_text("", "case.toml"));
  end.kind = Load::Kind::force;
  end.part.groups = {"x1"};
  end.value = Vec3(0, -young * inertia, 0);
  const auto unit = nodal_forces(end, mesh, plane);
  LargeDisplacements statics(mesh, rubber, fixed, {}, plane);
  for (const auto& [ratio, across, along] : {std::tuple{1.0, 0.301721, 0.056433},
                                             {2.0, 0.493457, 0.160642},
                                             {5.0, 0.713792, 0.387628},
                                             {10.0, 0.810609, 0.554996}}) {
    const auto solution = statics.solve(ratio * unit);
    const Vec3 tip = value_at(solution.displacement, mesh.nearest_node({1, height / 2, 0}), 2);
    EXPECT_NEAR(-tip[1], across, 1e-3 * across) << ratio;
    EXPECT_NEAR(-tip[0], along, 1e-3 * along) << ratio;
    EXPECT_NEAR(solution.total_reaction()[1], ratio * young * inertia,
                1e-8 * ratio * young * inertia);
  }
}

// A body turned as a whole has no strain: no internal force, and no stress.
TEST(LargeDisplacement, OfARigidRotationCostsNothing) {
  for (const auto law : {Material::Law::st_venant_kirchhoff, Material::Law::neo_hooke})
  for (const int dimension : {2, 3}) {
    const Mesh mesh(build(strip(dimension, 0.3, 3, 2)), 2);
    const Materials steel = Material{2e11, 0.3, {}, law};
    const Formulation large{.large = true};
    Vector u = mesh.zero();
    const double angle = 2.0;
    for (std::size_t n = 0; n < mesh.nodes(); ++n) {
      const auto& p = mesh.points()[n];
      add_at(u, n, dimension,
             Vec3(p[0] * (std::cos(angle) - 1) - p[1] * std::sin(angle),
                  p[0] * std::sin(angle) + p[1] * (std::cos(angle) - 1), 0));
    }
    const auto pattern = assemble_stiffness(mesh, steel).pattern();
    EXPECT_LT(linearise(mesh, steel, large, u, pattern).internal.lpNorm<Eigen::Infinity>(),
              1e-13 * 2e11);
    EXPECT_LT(Stress(mesh, steel, large).peak(u).value, 1e-13 * 2e11);
  }
}

// At u = 0 the tangent is the stiffness of small displacements; elsewhere it is the derivative of
// the internal force, to the error of central differences.
TEST(LargeDisplacement, HasTheDerivativeOfItsForceAsTangent) {
  for (const auto law : {Material::Law::st_venant_kirchhoff, Material::Law::neo_hooke})
  for (const int dimension : {2, 3}) {
    const Mesh mesh(build(strip(dimension, 0.5, 2, 1)), 2);
    const Materials soft = Material{1.0, 0.3, {}, law};
    const auto stiffness = assemble_stiffness(mesh, soft);
    Vector u(mesh.zero()), direction(mesh.zero()), a, b;
    for (Eigen::Index i = 0; i < u.size(); ++i) {
      u[i] = 0.05 * std::sin(3.0 * static_cast<double>(i));
      direction[i] = std::cos(5.0 * static_cast<double>(i));
    }
    linearise(mesh, soft, {}, mesh.zero(), stiffness.pattern()).tangent.multiply(direction, a);
    stiffness.multiply(direction, b);
    EXPECT_LT((a - b).norm(), 1e-13 * b.norm());
    const double h = 1e-5;
    linearise(mesh, soft, {}, u, stiffness.pattern()).tangent.multiply(direction, a);
    b = (linearise(mesh, soft, {}, u + h * direction, stiffness.pattern()).internal -
         linearise(mesh, soft, {}, u - h * direction, stiffness.pattern()).internal) /
        (2 * h);
    EXPECT_LT((a - b).norm(), 1e-7 * b.norm());
  }
}

// A bar of neo-Hooke stretched to twice its length, its sides free: σ_11 = (μ (λ₁² − 1) + λ ln J) / J with J = λ₁ λ₂² and λ₂ from
// σ_22 = 0, found by bisection. A homogeneous strain is exact in every mesh; Newton stops at 1e-11.
TEST(NeoHooke, StretchesAsItsClosedFormSays) {
  const Material rubber{1e6, 0.3, {}, Material::Law::neo_hooke};
  const double stretch = 2, mu = rubber.mu(), lambda = rubber.lambda();
  double low = 0.1, high = 1;
  for (int k = 0; k < 200; ++k) {
    const double middle = 0.5 * (low + high);
    (mu * (middle * middle - 1) + lambda * std::log(stretch * middle * middle) > 0 ? high : low) = middle;
  }
  const double volume = stretch * low * low;
  const double sigma = (mu * (stretch * stretch - 1) + lambda * std::log(volume)) / volume;
  const Mesh mesh(build(strip(3, 0.5, 2, 1)), 1);
  const Formulation large{.large = true};
  Fixed fixed(mesh.unknowns(), 0);
  hold(mesh.boundary("x0"), {true, false, false}, fixed);
  hold(mesh.boundary("x1"), {true, false, false}, fixed);
  hold(mesh.boundary("y0"), {false, true, false}, fixed);
  hold(mesh.boundary("z0"), {false, false, true}, fixed);
  Vector prescribed = mesh.zero();
  for (std::size_t n = 0; n < mesh.nodes(); ++n)
    if (mesh.points()[n][0] == 1) add_at(prescribed, n, 3, Vec3(stretch - 1, 0, 0));
  const Materials materials(rubber);
  LargeDisplacements statics(mesh, materials, fixed, {}, large);
  const auto solution = statics.solve(mesh.zero(), prescribed);
  EXPECT_NEAR(value_at(solution.displacement, mesh.nearest_node({0, 0.5, 0}), 3)[1], 0.5 * (low - 1), 1e-10);
  EXPECT_NEAR(Stress(mesh, rubber, large).at_points(0, solution.displacement)(0, 0), sigma, 1e-9 * sigma);
  double pulled = 0;
  for (std::size_t n = 0; n < mesh.nodes(); ++n)
    if (mesh.points()[n][0] == 1) pulled += value_at(solution.reaction, n, 3)[0];
  EXPECT_NEAR(pulled, sigma * low * low * 0.25, 1e-9 * pulled);
}

// Pressed to a tenth of its height between rigid sides, neo-Hooke carries (μ (s² − 1) + λ ln s) / s, s = 0.1; St. Venant–Kirchhoff,
// whose force falls beyond s = 3^-1/2, would be pressed through under the same load.
TEST(NeoHooke, StandsCompressionToATenth) {
  const Material rubber{1e6, 0.3, {}, Material::Law::neo_hooke};
  const double s = 0.1, stress = (rubber.mu() * (s * s - 1) + rubber.lambda() * std::log(s)) / s;
  const Mesh mesh(build(strip(3, 0.5, 2, 1)), 1);
  const Formulation large{.large = true};
  Fixed fixed(mesh.unknowns(), 0);
  for (const char* side : {"y0", "y1"}) hold(mesh.boundary(side), {false, true, false}, fixed);
  for (const char* side : {"z0", "z1"}) hold(mesh.boundary(side), {false, false, true}, fixed);
  hold(mesh.boundary("x0"), {true, false, false}, fixed);
  Load push(io::Table::from_text("", "case.toml"));
  push.kind = Load::Kind::traction;
  push.part.groups = {"x1"};
  push.value = Vec3(stress, 0, 0);
  const Materials materials(rubber);
  LargeDisplacements statics(mesh, materials, fixed, {}, large);
  const auto solution = statics.solve(nodal_forces(push, mesh, large));
  EXPECT_NEAR(value_at(solution.displacement, mesh.nearest_node({1, 0, 0}), 3)[0], s - 1, 1e-10);
}

}  // namespace
}  // namespace acopla::fem::test
