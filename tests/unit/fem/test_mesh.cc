#include "fem/mesh.h"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

#include "cells.h"
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
  expect_in(failure(write_file("order.msh", text)), "Mesh.ElementOrder = 1");
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
