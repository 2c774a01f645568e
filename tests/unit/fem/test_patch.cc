// Patch tests: a uniform stress is reproduced exactly, whatever the shape of the cells.
#include <gtest/gtest.h>

#include "cells.h"
#include "coupler/mapping/mapping.h"
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

/// Uniform tension of a bar that may contract: u = (p/E) (x, −ν y, −ν z). @param forces  of the nodes of x1 [N]
void expect_uniform_tension(const Mesh& patch, const std::vector<Vec3>& forces) {
  Fixed fixed(3 * patch.nodes(), 0);
  hold(patch.boundary("x0"), {true, false, false}, fixed);
  hold(patch.boundary("y0"), {false, true, false}, fixed);
  hold(patch.boundary("z0"), {false, false, true}, fixed);
  const Material material{young, poisson, {}};
  Statics statics(patch, material, fixed, {});
  statics.prepare();

  Vector load = patch.zero();
  Interface(patch, "x1").add_forces(forces, load);
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

Vec3 tension(const Vec3&, const Vec3& normal) { return pressure * normal; }

// The loads are those of the interface's own faces, so that a wrong order of the nodes of a face fails here.
TEST_P(Patch, UniformTensionOfTheInterfaceGivesUniformStress) {
  const auto patch = mesh();
  expect_uniform_tension(patch, traction_loads(Interface(patch, "x1").surface(), tension));
}

std::vector<Vec3> mapped(const geometry::SurfaceMesh& from, const std::vector<Vec3>& forces, const geometry::SurfaceMesh& to) {
  const coupler::Mapping mapping(from, to, {1e-9});
  EXPECT_EQ(mapping.unmapped(), 0u);
  std::vector<Vec3> result(to.points.size());
  mapping.forces(forces, result);
  return result;
}

// The coupler's operator takes forces to the nodes by the faces' own shape functions: the forces of a pressure at the quadrature points of
// the faces, as many particles would press there, become the consistent loads, whatever the order and shape of the faces.
TEST_P(Patch, UniformPressureOfPointsThroughTheCouplersOperatorGivesUniformStress) {
  const auto patch = mesh();
  const Interface end(patch, "x1");
  geometry::SurfaceMesh points;
  std::vector<Vec3> forces;
  for (std::size_t f = 0; f < end.surface().face_count(); ++f)
    integrate(end.surface(), f, [&](const Eigen::VectorXd&, const Vec3& point, const Vec3& area) {
      points.points.push_back(point);
      forces.push_back(pressure * area);
    });
  expect_uniform_tension(patch, mapped(points, forces, end.surface()));
}

// From the consistent loads of a surface of the same order with each of its faces cut into four: the shape functions of a large face are
// functions of the small ones, so that nothing is lost.
TEST_P(Patch, UniformPressureOfAFinerSurfaceThroughTheCouplersOperatorGivesUniformStress) {
  const auto [tetrahedra, degree] = GetParam();
  const Mesh patch(write_block("coarse", {.cells = {3, 2, 3}, .tetrahedra = tetrahedra}), degree),
      fine(write_block("fine", {.cells = {6, 4, 6}, .tetrahedra = tetrahedra}), degree);
  const Interface end(patch, "x1"), sender(fine, "x1");
  expect_uniform_tension(patch, mapped(sender.surface(), traction_loads(sender.surface(), tension), end.surface()));
}

// A wall of triangles on faces of second order: the forces at its corners see these shape functions interpolated along straight lines, which
// costs the loads an error of h², and the sum nothing.
TEST(PatchOfTriangles, OnFacesOfSecondOrderConvergesWithOrderTwo) {
  const Mesh patch(write_block("coarse", {.cells = {2, 2, 2}}), 2);
  const Interface end(patch, "x1");
  const auto exact = traction_loads(end.surface(), tension);
  std::vector<double> errors;
  for (const int n : {6, 12, 24}) {
    const Mesh wall(write_block("wall", {.cells = {1, n, n}, .tetrahedra = true}), 1);
    const Interface sender(wall, "x1");
    const auto loads = mapped(sender.surface(), traction_loads(sender.surface(), tension), end.surface());
    double error = 0;
    Vec3 sum = Vec3::Zero();
    for (std::size_t i = 0; i < loads.size(); ++i) {
      error += (loads[i] - exact[i]).squaredNorm();
      sum += loads[i];
    }
    errors.push_back(std::sqrt(error));
    EXPECT_LT((sum - Vec3(pressure, 0, 0)).norm(), 1e-13 * pressure);
  }
  EXPECT_NEAR(std::log2(errors[0] / errors[1]), 2, 0.1);
  EXPECT_NEAR(std::log2(errors[1] / errors[2]), 2, 0.05);
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
