#include "fem/interface.h"

#include <gtest/gtest.h>

#include "cells.h"
#include "gmsh_writer.h"
#include "tractions.h"

namespace acopla::fem::test {
namespace {

class Faces : public testing::TestWithParam<CellKind> {
 protected:
  Mesh mesh(double version = 4.1) const {
    const auto [tetrahedra, degree] = GetParam();
    return {write_block("block", {.size = {1, 1, 1},
                                  .cells = {3, 2, 4},
                                  .tetrahedra = tetrahedra,
                                  .version = version,
                                  .move = distort}),
            degree};
  }
};

INSTANTIATE_TEST_SUITE_P(Cells, Faces, all_kinds(), name_of_kind);

// Sides stay plane under the distortion: area 1 each, and ∫ n dA is the side's outward normal.
TEST_P(Faces, HaveTheAreaOfTheirSideAndPointOutward) {
  const auto block = mesh();
  const std::string sides[] = {"x0", "x1", "y0", "y1", "z0", "z1"};
  for (int s = 0; s < 6; ++s) {
    const Interface interface(block, sides[s]);
    const Vec3 outward = (s % 2 ? 1.0 : -1.0) * Vec3::Unit(s / 2);
    Vec3 area = Vec3::Zero();
    for (std::size_t f = 0; f < interface.surface().face_count(); ++f)
      integrate(interface.surface(), f, [&](const Eigen::VectorXd&, const Vec3&, const Vec3& dA) {
        EXPECT_GT(dA.dot(outward), 0);
        area += dA;
      });
    EXPECT_LT((area - outward).norm(), 1e-12) << sides[s];
  }
}

// In VTK's order node 4 + i of a quadrangle (3 + i of a triangle) lies in the middle of edge i, and
// node 8 in the centre of the corners, because cells have straight edges.
TEST_P(Faces, OfSecondOrderHaveTheirMiddlesWhereVtkExpectsThem) {
  if (GetParam().degree == 1) GTEST_SKIP();
  const Interface interface(mesh(), "y1");
  const auto& surface = interface.surface();
  for (std::size_t f = 0; f < surface.face_count(); ++f) {
    const auto nodes = surface.nodes(f);
    const auto corners = geometry::corners_of(surface.kind(f));
    ASSERT_EQ(nodes.size(), GetParam().tetrahedra ? 6u : 9u);
    Vec3 centre = Vec3::Zero();
    for (std::size_t i = 0; i < corners; ++i) {
      const Vec3 a = surface.points[nodes[i]], b = surface.points[nodes[(i + 1) % corners]];
      EXPECT_LT((surface.points[nodes[corners + i]] - 0.5 * (a + b)).norm(), 1e-14);
      centre += a / static_cast<double>(corners);
    }
    if (corners == 4) {
      EXPECT_LT((surface.points[nodes[8]] - centre).norm(), 1e-14);
    }
  }
}

TEST_P(Faces, AreTheSameFromBothFormatsOfGmsh) {
  const Interface four(mesh(4.1), "z1"), two(mesh(2.2), "z1");
  EXPECT_EQ(four.nodes(), two.nodes());
  EXPECT_EQ(four.surface().connectivity(), two.surface().connectivity());
  EXPECT_EQ(four.surface().points, two.surface().points);
}

TEST(Interface, AddsForcesToItsNodesAndReadsThemBack) {
  const Mesh block(write_block("block"), 2);
  const Interface interface(block, "x1");
  std::vector<Vec3> forces;
  for (std::size_t i = 0; i < interface.nodes().size(); ++i)
    forces.emplace_back(static_cast<double>(i), 1.0, -2.0);
  Vector load = Vector::Zero(3 * static_cast<int>(block.nodes()));
  interface.add_forces(forces, load);
  interface.add_forces(forces, load);
  const auto back = interface.values(load);
  for (std::size_t i = 0; i < forces.size(); ++i) {
    EXPECT_EQ(back[i], Vec3(2 * forces[i]));
    EXPECT_EQ(block.points()[interface.nodes()[i]], interface.surface().points[i]);
    EXPECT_EQ(interface.surface().points[i][0], 1.0);
  }
  EXPECT_EQ(load.reshaped(3, load.size() / 3).row(1).sum(),
            2.0 * static_cast<double>(forces.size()));
}

TEST(Interface, RefusesForcesThatAreTooFewOrNotFinite) {
  const Mesh block(write_block("block"), 1);
  const Interface interface(block, "x1");
  Vector load = Vector::Zero(3 * static_cast<int>(block.nodes()));
  std::vector<Vec3> forces(interface.nodes().size() - 1, Vec3::Zero());
  EXPECT_THROW(interface.add_forces(forces, load), std::invalid_argument);
  forces.emplace_back(0, NAN, 0);
  EXPECT_THROW(interface.add_forces(forces, load), std::invalid_argument);
}

}  // namespace
}  // namespace acopla::fem::test
