// Patch tests: a uniform stress is reproduced exactly, whatever the shape of the cells.
#include <gtest/gtest.h>

#include "cells.h"
#include "fem/interface.h"
#include "fem/statics.h"
#include "fem/stress.h"
#include "gmsh_writer.h"
#include "tractions.h"

namespace acopla::fem::test {
namespace {

constexpr double young = 2.1e11, poisson = 0.3, pressure = 1e6;

class Patch : public testing::TestWithParam<CellKind> {
 protected:
  Mesh mesh() const {
    const auto [tetrahedra, degree] = GetParam();
    return {write_block("patch", {.cells = {3, 2, 3}, .tetrahedra = tetrahedra, .move = distort}),
            degree};
  }
};

INSTANTIATE_TEST_SUITE_P(Cells, Patch, all_kinds(), name_of_kind);

// A linear displacement has a uniform stress, which loads no node inside the body: exact but for
// the round-off of sums of terms of size |K| |u|.
TEST_P(Patch, LinearDisplacementLoadsNoNodeInside) {
  const auto patch = mesh();
  const auto stiffness = assemble_stiffness(patch, Material{young, poisson, {}});
  Eigen::Matrix3d slope;
  slope << 1e-3, 2e-3, -1e-3, 4e-4, -2e-3, 3e-4, 5e-4, 6e-4, 7e-4;
  Vector u(3 * static_cast<int>(patch.nodes())), force;
  for (std::size_t n = 0; n < patch.nodes(); ++n)
    u.segment<3>(3 * static_cast<int>(n)) = slope * patch.points()[n];
  stiffness.multiply(u, force);
  const double scale = stiffness.norm() * u.lpNorm<Eigen::Infinity>();
  int inside = 0;
  for (std::size_t n = 0; n < patch.nodes(); ++n) {
    const auto& p = patch.points()[n];
    if (p.minCoeff() < 1e-9 || p.maxCoeff() > 1 - 1e-9) continue;
    EXPECT_LT(force.segment<3>(3 * static_cast<int>(n)).norm(), 1e-14 * scale);
    ++inside;
  }
  EXPECT_GT(inside, 0);
}

// Uniform tension of a bar that may contract: u = (p/E) (x, −ν y, −ν z). The loads are those of the
// interface's own faces, so that a wrong order of the nodes of a face fails here.
TEST_P(Patch, UniformTensionOfTheInterfaceGivesUniformStress) {
  const auto patch = mesh();
  Fixed fixed(3 * patch.nodes(), 0);
  hold(patch.boundary("x0"), {true, false, false}, fixed);
  hold(patch.boundary("y0"), {false, true, false}, fixed);
  hold(patch.boundary("z0"), {false, false, true}, fixed);
  const Material material{young, poisson, {}};
  Statics statics(patch, material, fixed, {});
  statics.prepare();

  const Interface end(patch, "x1");
  Vector load = Vector::Zero(3 * static_cast<int>(patch.nodes()));
  end.add_forces(
      traction_loads(end.surface(), [](const Vec3&, const Vec3& n) { return Vec3(pressure * n); }),
      load);
  const auto solution = statics.solve(load);

  const double strain = pressure / young;
  for (std::size_t n = 0; n < patch.nodes(); ++n) {
    const auto& p = patch.points()[n];
    const Vec3 exact = strain * Vec3(p[0], -poisson * p[1], -poisson * p[2]);
    const Vec3 error = solution.displacement.segment<3>(3 * static_cast<int>(n)) - exact;
    EXPECT_LT(error.norm(), 1e-11 * strain);  // condition of some 1e4 times round-off
  }
  const Stress stress(patch, material);
  StressVector uniform = StressVector::Zero();
  uniform[0] = pressure;
  for (std::size_t c = 0; c < patch.cells(); ++c) {
    const auto found = stress.at_points(c, solution.displacement);
    EXPECT_LT((found.colwise() - uniform).lpNorm<Eigen::Infinity>(), 1e-9 * pressure);
  }
  const auto nodal = stress.nodal_von_mises(solution.displacement);
  EXPECT_LT((nodal.array() - pressure).abs().maxCoeff(), 1e-9 * pressure);
  EXPECT_NEAR(solution.total_reaction()[0], -pressure, 1e-10 * pressure);
}

TEST(VonMises, OfUniaxialAndShearAndHydrostaticStress) {
  StressVector uniaxial = StressVector::Zero(), shear = uniaxial, hydrostatic = uniaxial;
  uniaxial[2] = -3;
  shear[4] = 2;
  hydrostatic.head<3>().setConstant(7);
  EXPECT_DOUBLE_EQ(von_mises(uniaxial), 3);
  EXPECT_DOUBLE_EQ(von_mises(shear), 2 * std::sqrt(3));
  EXPECT_DOUBLE_EQ(von_mises(hydrostatic), 0);
  EXPECT_LT((principal(uniaxial) - Vec3(0, 0, -3)).norm(), 1e-15);
  EXPECT_LT((principal(shear) - Vec3(2, 0, -2)).norm(), 1e-14);
}

}  // namespace
}  // namespace acopla::fem::test
