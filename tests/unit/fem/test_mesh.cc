#include "fem/mesh.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "cells.h"
#include "fem/picture.h"
#include "gmsh_writer.h"
#include "io/error.h"

namespace acopla::fem::test {
namespace {

std::string failure(const std::string& path, int degree = 1, int dimension = 3) {
  try {
    const Mesh mesh(path, degree, dimension);
  } catch (const io::UserError& error) {
    return error.what();
  }
  return "no error";
}

void expect_in(const std::string& text, const std::string& part) {
  EXPECT_NE(text.find(part), std::string::npos) << text;
}

class Cells : public testing::TestWithParam<CellKind> {};
INSTANTIATE_TEST_SUITE_P(Kinds, Cells, all_kinds(), name_of_kind);

TEST_P(Cells, FillTheBlockWithTheNodesOfTheirOrder) {
  const auto [tetrahedra, degree] = GetParam();
  const Mesh mesh(
      write_block("block", {.cells = {3, 2, 4}, .tetrahedra = tetrahedra, .move = distort}),
      degree);
  EXPECT_EQ(mesh.cells(), tetrahedra ? 144u : 24u);
  EXPECT_EQ(mesh.nodes(), degree == 1 ? 4u * 3 * 5 : 7u * 5 * 9);
  EXPECT_NEAR(mesh.volume(), 1, 1e-13);
}

TEST(Groups, AreReadWithTheirDimensions) {
  const auto groups = read_physical_groups(write_block("block"));
  ASSERT_EQ(groups.size(), 11u);
  EXPECT_EQ(groups[1].name, "x1");
  EXPECT_EQ(groups[1].dimension, 2);
  EXPECT_EQ(groups[1].id, 2);
  EXPECT_EQ(groups[6].name, "solid");
  EXPECT_EQ(groups[6].dimension, 3);
}

TEST(Groups, ThatAreMissingOrNoSurfacesAreRefusedWithThoseThatAreThere) {
  const Mesh mesh(write_block("block"), 1);
  const auto failure_of = [&](const std::string& name) -> std::string {
    try {
      mesh.boundary(name);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "no error";
  };
  EXPECT_EQ(failure_of("z2").substr(0, 19), "is not in the mesh.");
  expect_in(failure_of("z2"), "The mesh has the surfaces x0, x1, y0, y1, z0, z1.");
  expect_in(failure_of("z2"), "Did you mean \"z");
  expect_in(failure_of("solid"), "is made of volumes; a surface is needed here.");
  expect_in(failure_of("edge"), "is made of curves");
}

TEST(Reading, RefusesWhatIsNotAMesh) {
  expect_in(failure("/nowhere/mesh.msh"), "/nowhere/mesh.msh: cannot be read");
  expect_in(failure(write_file("text.msh", "solid cube\n")), "is not a gmsh mesh");
  expect_in(failure(write_file("old.msh", "$MeshFormat\n1.0 0 8\n")), "version 2 or 4");
  expect_in(failure(write_file("binary.msh", "$MeshFormat\n4.1 1 8\n")), "Save it as ASCII");
}

TEST(Reading, RefusesAMeshThatStopsInTheMiddle) {
  const auto whole = write_block("whole", {.version = 2.2});
  std::ifstream file(whole);
  const std::string text(std::istreambuf_iterator<char>(file), {});
  const auto path = write_file("half.msh", text.substr(0, text.size() / 2));
  expect_in(failure(path), "the file ends in the middle of a section");
}

TEST(Reading, RefusesAMeshOfSurfacesOnly) {
  const auto path = write_file("surface.msh",
                               "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n3\n1 0 0 0\n2 1 0 0\n"
                               "3 0 1 0\n$EndNodes\n$Elements\n1\n1 2 2 1 1 1 2 3\n$EndElements\n");
  expect_in(failure(path), "Physical Volume");
}

TEST(Reading, SaysInWhichLineAMeshIsWrong) {
  std::string text =
      "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n"
      "$EndNodes\n$Elements\n1\n1 4 2 1 1 1 2 3 5\n$EndElements\n";
  expect_in(failure(write_file("node.msh", text)), "node.msh:13: there is no node 5.");
  text.replace(text.find("1 4 2 1 1"), 9, "1 6 2 1 1");
  expect_in(failure(write_file("prism.msh", text)), "prism.msh:13: prisms and pyramids");
  text.replace(text.find("1 6 2 1 1"), 9, "1 11 2 1 1");
  expect_in(failure(write_file("order.msh", text)), "order.msh:13: there is no node 5.");
  text.replace(text.find("1 11 2 1 1"), 10, "1 21 2 1 1");
  expect_in(failure(write_file("third.msh", text)), "third.msh:13: elements of gmsh's type 21 cannot be used. Save elements of first or second order");
  text.replace(text.find("1 21 2 1 1"), 10, "1 17 2 1 1");
  expect_in(failure(write_file("serendipity.msh", text)), "hexahedra of 20 nodes have no nodes in the middle of faces and cell");
  text.replace(text.find("1 17 2 1 1"), 10, "1 16 2 1 1");
  expect_in(failure(write_file("serendipity.msh", text)), "quadrilaterals of 8 nodes have no nodes in the middle of the cell, where the cells of second order here do. Save complete ones (Mesh.SecondOrderIncomplete = 0)");
  text.replace(text.find("2 1 0 0"), 7, "2 1 0 a");
  expect_in(failure(write_file("number.msh", text)), "number.msh:7: \"a\" is not a number.");
}

// The volume is the same whichever way gmsh counts the corners of a cell.
TEST(Reading, TurnsLeftHandedCells) {
  const auto mirror = [](const Vec3& p) { return Vec3(-p[0], p[1], p[2]); };
  for (const bool tetrahedra : {false, true}) {
    const Mesh mesh(write_block("mirrored", {.tetrahedra = tetrahedra, .move = mirror}), 1);
    EXPECT_NEAR(mesh.volume(), 1, 1e-14);
    EXPECT_EQ(mesh.boundary("x1").size(), tetrahedra ? 8u : 4u);
  }
}

// A block bent to an arc, written with elements of second order: every node of the mesh is where the bend takes the node of the straight block,
// in both formats, and the faces and parts are those of the corners. Displacements of first order take the corners.
TEST(MeshesOfSecondOrder, HaveTheirNodesWhereTheFileHasThem) {
  const auto bend = [](const Vec3& p) {
    const double angle = 1.2 * p[0], radius = 2 + p[1];
    return Vec3(radius * std::sin(angle), radius * std::cos(angle), p[2] + 0.1 * p[0] * p[0]);
  };
  for (const bool tetrahedra : {false, true})
    for (const double version : {2.2, 4.1}) {
      const auto path = write_block("bent", {.tetrahedra = tetrahedra, .version = version, .order = 2, .two_solids = true, .move = bend});
      const auto straight_path = write_block("straight", {.tetrahedra = tetrahedra, .version = version, .two_solids = true});
      for (const int degree : {1, 2}) {
        const Mesh mesh(path, degree), straight(straight_path, degree);
        ASSERT_EQ(mesh.nodes(), straight.nodes());
        EXPECT_EQ(mesh.curved(), degree == 2);
        for (std::size_t n = 0; n < mesh.nodes(); ++n)
          EXPECT_LT((mesh.points()[n] - bend(straight.points()[n])).norm(), 1e-15) << n;
        for (const char* side : {"x0", "x1", "y0", "y1", "z0", "z1"})
          EXPECT_EQ(mesh.boundary(side).size(), straight.boundary(side).size());
        EXPECT_EQ(mesh.curve("ridge").size(), 2u);
        EXPECT_EQ(mesh.solid("other").size(), straight.solid("other").size());
        const auto picture = write_file("bent.vtu", "");
        write_picture(picture, mesh, mesh.zero(), Vector::Zero(static_cast<Eigen::Index>(mesh.nodes())));
        EXPECT_GT(std::filesystem::file_size(picture), 1000u);
      }
    }
}

// A quarter of a ring between radii 1 and 2 of one quadrilateral of 9 nodes, or two triangles of 6. Its area by the shape functions, which
// are the edges' parabolas, to their error of a tenth; that of the polygon of its corners is 3/2.
TEST(MeshesOfSecondOrder, AreCurvedInThePlaneToo) {
  const std::string head =
      "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n1 1 \"inside\"\n2 2 \"solid\"\n$EndPhysicalNames\n$Nodes\n9\n";
  const double c = std::sqrt(0.5);
  const Vec3 at[] = {{1, 0, 0}, {2, 0, 0}, {0, 2, 0}, {0, 1, 0}, {1.5, 0, 0}, {2 * c, 2 * c, 0}, {0, 1.5, 0}, {c, c, 0}, {1.5 * c, 1.5 * c, 0}};
  std::string nodes;
  for (int n = 0; n < 9; ++n) {
    char line[100];
    std::snprintf(line, sizeof line, "%d %.17g %.17g 0\n", n + 1, at[n][0], at[n][1]);
    nodes += line;
  }
  const std::string inside = "$EndNodes\n$Elements\n", line = "1 8 2 1 1 4 1 8\n";
  const auto quad = write_file("quad.msh", head + nodes + inside + "2\n" + line + "2 10 2 2 1 1 2 3 4 5 6 7 8 9\n$EndElements\n");
  const auto triangles =
      write_file("triangles.msh", head + nodes + inside + "3\n" + line + "2 9 2 2 1 1 2 3 5 6 9\n3 9 2 2 1 1 3 4 9 7 8\n$EndElements\n");
  for (const auto& path : {quad, triangles}) {
    const Mesh mesh(path, 2, 2);
    EXPECT_EQ(mesh.nodes(), 9u);
    EXPECT_NEAR(mesh.volume(), 0.75 * 3.14159265358979, 0.1);
    EXPECT_NEAR(Mesh(path, 1, 2).volume(), 1.5, 1e-14);
    const auto faces = mesh.boundary("inside");
    ASSERT_EQ(faces.size(), 1u);
    EXPECT_LT((mesh.points()[faces[0].nodes[2]] - at[7]).norm(), 1e-15);
  }
}

TEST(Reading, LetsAFaceBeInTwoGroups) {
  const auto path = write_file(
      "shared.msh",
      "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n3\n2 1 \"base\"\n2 2 \"all\"\n"
      "3 7 \"solid\"\n$EndPhysicalNames\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$EndNodes\n"
      "$Elements\n5\n1 2 2 1 1 1 2 3\n2 2 2 2 1 1 2 3\n3 2 2 2 1 1 2 4\n4 4 2 7 1 1 2 3 4\n"
      "5 4 2 7 1 1 2 3 4\n$EndElements\n");
  const Mesh mesh(path, 2);
  EXPECT_EQ(mesh.cells(), 1u);
  EXPECT_EQ(mesh.boundary("base").size(), 1u);
  EXPECT_EQ(mesh.boundary("all").size(), 2u);
}

TEST(Reading, RefusesCellsFoldedOverThemselvesAndSaysWhere) {
  const auto fold = [](const Vec3& p) -> Vec3 {
    return (p - Vec3(0.5, 0.5, 0.5)).norm() < 0.1 ? Vec3(1.4, 0.5, 0.5) : p;
  };
  const auto text = failure(write_block("folded", {.move = fold}), 2);
  expect_in(text, "folded.msh: has a cell that is folded over itself");
  expect_in(text, "around (");
  // a quadrilateral whose sides cross
  const auto crossed = write_file("crossed.msh",
                                  "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n$EndNodes\n"
                                  "$Elements\n1\n1 3 2 1 1 1 2 4 3\n$EndElements\n");
  expect_in(failure(crossed, 1, 2), "crossed.msh: has a cell that is folded over itself, around (0.5 0.5)");
}

}  // namespace
}  // namespace acopla::fem::test
