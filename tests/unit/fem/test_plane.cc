// Structures in 2D: plane strain and plane stress, quadrilaterals and triangles.
#include <gtest/gtest.h>

#include "cells.h"
#include "fem/faces.h"
#include "fem/interface.h"
#include "fem/structure.h"
#include "gmsh_writer.h"
#include "solved.h"

namespace acopla::fem::test {
namespace {

constexpr double young = 2.1e11, poisson = 0.3, pressure = 1e6;

/// The unit square, its inner nodes moved.
Grid square(bool triangles) {
  return {.name = "square",
          .dimension = 2,
          .cells = {3, 4, 1},
          .simplices = triangles,
          .corner =
              [](const GridIndex& i) {
                Vec3 p = distort(Vec3(i[0] / 3.0, i[1] / 4.0, 0.3));
                p[2] = 0;
                return p;
              },
          .sides = side_name};
}

std::string case_of(int degree, const std::string& more) {
  return "dimension = 2\n[structure]\nmesh = { bar = { size = [1, 1], cells = [1, 1] } }\ndegree "
         "= " +
         std::to_string(degree) + "\n" + more;
}
const std::string steel = "[structure.material]\nyoung = 2.1e11\npoisson = 0.3\n";

class Plane : public testing::TestWithParam<CellKind> {};
INSTANTIATE_TEST_SUITE_P(Cells, Plane, all_kinds(),
                         [](const auto& tested) { return name_of(tested.param); });

// Tension p along x of a plate that may contract. Plane stress: ε = p/E (1, −ν), σ_zz = 0. Plane
// strain: ε = p (1 − ν²)/E (1, −ν/(1 − ν)), σ_zz = ν p. Exact but for round-off times a condition
// of some 1e3. A thickness t scales forces and reactions.
TEST_P(Plane, UniformTensionGivesUniformStress) {
  const auto [triangles, degree] = GetParam();
  const auto grid = square(triangles);
  const std::string load =
      "[structure.fix.x0]\ndirections = [\"x\"]\n[structure.fix.y0]\ndirections = [\"y\"]\n"
      "[structure.load.x1]\ntraction = [1e6, 0]\n";
  for (const bool stress : {true, false}) {
    const Solved solved(
        case_of(degree, (stress ? "plane = \"stress\"\nthickness = 0.25\n" : "") + steel + load),
        Vec3::Zero(), &grid);
    const double along = pressure / young * (stress ? 1 : 1 - poisson * poisson);
    const double across = -along * (stress ? poisson : poisson / (1 - poisson));
    for (std::size_t n = 0; n < solved.mesh().nodes(); ++n) {
      const auto& p = solved.mesh().points()[n];
      EXPECT_LT(
          (value_at(solved.solution().displacement, n, 2) - Vec3(along * p[0], across * p[1], 0))
              .norm(),
          1e-11 * along);
    }
    StressVector exact = StressVector::Zero();
    exact[0] = pressure;
    exact[2] = stress ? 0 : poisson * pressure;
    for (std::size_t c = 0; c < solved.mesh().cells(); ++c) {
      const auto found = solved.stress().at_points(c, solved.solution().displacement);
      EXPECT_LT((found.colwise() - exact).lpNorm<Eigen::Infinity>(), 1e-9 * pressure);
    }
    EXPECT_NEAR(solved.solution().total_reaction()[0], -pressure * (stress ? 0.25 : 1),
                1e-10 * pressure);
  }
}

// Lines of the boundary: length 1 a side, and outward on the right.
TEST_P(Plane, InterfacesAreLinesWithTheBodyOnTheirLeft) {
  const auto [triangles, degree] = GetParam();
  const Mesh mesh(build(square(triangles)), degree);
  for (int s = 0; s < 4; ++s) {
    const auto faces = mesh.boundary(side_name(s, {})[0]);
    EXPECT_EQ(faces.size(), s < 2 ? 4u : 3u);
    Vec3 normal = Vec3::Zero();
    for (const auto& face : faces)
      visit_face(mesh, face, [&](const FacePoint& point) { normal += point.area; });
    EXPECT_LT((normal - (s % 2 ? 1.0 : -1.0) * Vec3::Unit(s / 2)).norm(), 1e-13);
    const Interface interface(mesh, side_name(s, {})[0]);
    EXPECT_EQ(interface.surface().kind(0),
              degree == 1 ? geometry::FaceKind::line2 : geometry::FaceKind::line3);
    for (std::size_t f = 0; f < interface.surface().face_count(); ++f) {
      const auto nodes = interface.surface().nodes(f);
      if (degree == 2) {
        EXPECT_LT(
            (interface.surface().points[nodes[2]] -
             0.5 * (interface.surface().points[nodes[0]] + interface.surface().points[nodes[1]]))
                .norm(),
            1e-14);
      }
    }
  }
}

TEST_P(Plane, WeightIsThatOfTheArea) {
  const auto [triangles, degree] = GetParam();
  const auto grid = square(triangles);
  const Solved solved(
      case_of(
          degree,
          "[structure.material]\nyoung = 1e9\npoisson = 0.2\ndensity = 2000\n[structure.fix.y0]\n"),
      Vec3(0, -10, 0), &grid);
  EXPECT_NEAR(solved.solution().total_reaction()[1], 2000 * 10, 1e-10 * 2e4);
}

/// Two quadrilaterals in gmsh 2, the second turned the wrong way round.
std::string two_squares(const std::string& z = "0") {
  return "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n4\n1 1 \"left\"\n2 2 \"soft\"\n2 3 "
         "\"hard\"\n0 4 \"tip\"\n$EndPhysicalNames\n"
         "$Nodes\n6\n1 0 0 0\n2 1 0 0\n3 2 0 0\n4 0 1 0\n5 1 1 0\n6 2 1 " +
         z +
         "\n$EndNodes\n$Elements\n4\n1 1 2 1 1 1 4\n"
         "2 3 2 2 1 1 2 5 4\n3 3 2 3 2 2 5 6 3\n4 15 2 4 1 6\n$EndElements\n";
}

TEST(MeshesInThePlane, AreReadWithTheirGroups) {
  const Mesh mesh(write_file("two.msh", two_squares()), 2, 2);
  EXPECT_EQ(mesh.cells(), 2u);
  EXPECT_EQ(mesh.nodes(), 15u);
  EXPECT_DOUBLE_EQ(mesh.volume(), 2);
  EXPECT_EQ(mesh.solid("hard"), std::vector<std::uint32_t>{1});
  EXPECT_EQ(mesh.boundary("left").size(), 1u);
  EXPECT_EQ(mesh.points()[mesh.places("tip").at(0)], Vec3(2, 1, 0));
}

TEST(MeshesInThePlane, ThatAreNoneAreRefused) {
  const auto failure = [](const std::string& path, int dimension) -> std::string {
    try {
      const Mesh mesh(path, 1, dimension);
    } catch (const io::UserError& error) {
      return error.what();
    }
    return "no error";
  };
  EXPECT_NE(failure(write_file("bent.msh", two_squares("0.1")), 2).find("off the plane z = 0"),
            std::string::npos);
  EXPECT_NE(
      failure(write_block("solid"), 2).find("has solid cells, but the case says dimension = 2"),
      std::string::npos);
  EXPECT_NE(failure(write_file("flat.msh", two_squares()), 3).find("Physical Volume"),
            std::string::npos);
}

TEST(StructuresInThePlane, MoveAndTurnFreelyWhenNothingHoldsThem) {
  const auto failure = [](const std::string& more) -> std::string {
    try {
      const Solved solved(case_of(2, more));
    } catch (const io::UserError& error) {
      return error.what();
    }
    return "no error";
  };
  EXPECT_NE(
      failure(steel + "[structure.fix.x0]\ndirections = [\"x\"]\n").find("free to move along y."),
      std::string::npos);
  EXPECT_NE(failure(steel + "[structure.fix.x0]\ndirections = [\"z\"]\n")
                .find("directions are \"x\" and \"y\"."),
            std::string::npos);
  EXPECT_NE(failure("plane = \"stress\"\nlocking = \"b_bar\"\n" + steel)
                .find("nothing to cure in plane stress"),
            std::string::npos);
  EXPECT_NE(failure("displacements = \"large\"\nlocking = \"b_bar\"\n" + steel)
                .find("do not go together"),
            std::string::npos);
  EXPECT_NE(failure("displacements = \"large\"\nanalysis = \"dynamic\"\nnewmark = { beta = 0.25 }\n" + steel)
                .find("structure.newmark belongs to displacements = \"small\""),
            std::string::npos);
  EXPECT_NE(failure("thickness = 0\n" + steel).find("structure.thickness"), std::string::npos);
  EXPECT_NE(failure(steel + "[structure.fix.x0]\n[structure.load.y1]\nline_force = [0, 1]\n")
                .find("in 2D give a traction"),
            std::string::npos);
}

// Coupled in 2D: it introduces itself so, offers lines, and reports two directions; a thickness of
// its own is refused.
TEST(StructuresInThePlane, TakePartInACoupling) {
  const auto text = case_of(2, steel + "[structure.fix.y0]\n");
  protocol::Run run;
  run.tick = 0.1;
  run.end = run.window = 1;
  run.uses = {{"y1", {"force"}, {"displacement"}}};
  Structure structure(read_settings(io::Table::from_text(text, "case.toml"), "structure"));
  EXPECT_EQ(structure.introduce().dimension, 2);
  const auto surfaces = structure.start(run);
  std::vector<Vec3> forces(surfaces.at(0).mesh.points.size(), Vec3(0, -1, 0));
  const auto advance = structure.advance({0, 1, 0, 0.1}, {{"y1", "force", forces}});
  std::vector<std::string> names;
  for (const auto& [name, value] : advance.quantities) {
    names.push_back(name);
    if (name == "reaction.y") {
      EXPECT_NEAR(value, static_cast<double>(forces.size()), 1e-10);
    }
  }
  EXPECT_EQ(names, (std::vector<std::string>{"reaction.x", "reaction.y", "load.x", "load.y",
                                             "displacement.max", "von_mises.max"}));
  Structure thick(read_settings(
      io::Table::from_text(case_of(2, "thickness = 2\n" + steel + "[structure.fix.y0]\n"),
                           "case.toml"),
      "structure"));
  EXPECT_THROW(thick.start(run), io::UserError);
}

}  // namespace
}  // namespace acopla::fem::test
