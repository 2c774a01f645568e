#include "fem/supports.h"

#include <gtest/gtest.h>

#include "gmsh_writer.h"

namespace acopla::fem::test {
namespace {

struct Hold {
  std::string group;
  std::array<bool, 3> directions;
};

std::string free_with(const Mesh& mesh, const std::vector<Hold>& holds) {
  Fixed fixed(3 * mesh.nodes(), 0);
  for (const auto& [group, directions] : holds) hold(mesh.boundary(group), directions, fixed);
  return free_motions(mesh, fixed);
}

class Supports : public testing::Test {
 protected:
  Mesh mesh_{write_block("block", {.size = {2, 1, 1}}), 2};
};

TEST_F(Supports, HoldABodyByOneSideInAllDirections) {
  EXPECT_EQ(free_with(mesh_, {{"z0", {true, true, true}}}), "");
}

TEST_F(Supports, HoldABodyByThreeSidesInTheirNormals) {
  EXPECT_EQ(free_with(mesh_, {{"x0", {true, false, false}},
                              {"y0", {false, true, false}},
                              {"z0", {false, false, true}}}),
            "");
}

TEST_F(Supports, OnRollersLeaveTheBodyToSlideAndTurn) {
  EXPECT_EQ(free_with(mesh_, {{"z0", {false, false, true}}}),
            "turn about the axis along z through (1, 0.5, 0), move along x, move along y");
}

TEST_F(Supports, InTwoDirectionsLeaveTheThird) {
  EXPECT_EQ(free_with(mesh_, {{"x0", {true, true, false}}}), "move along z");
}

TEST_F(Supports, WithoutAnyAllSixMotionsAreFree) {
  EXPECT_EQ(free_with(mesh_, {}),
            "turn about the axis along x through (0, 0.5, 0.5), "
            "turn about the axis along y through (1, 0, 0.5), "
            "turn about the axis along z through (1, 0.5, 0), "
            "move along x, move along y, move along z");
}

TEST(SupportsOfTwoBodies, NameTheOneThatIsFree) {
  const auto path = write_file(
      "two.msh",
      "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n2 1 \"base\"\n$EndPhysicalNames\n"
      "$Nodes\n16\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n5 0 0 1\n6 1 0 1\n7 1 1 1\n8 0 1 1\n"
      "9 0 0 2\n10 1 0 2\n11 1 1 2\n12 0 1 2\n13 0 0 3\n14 1 0 3\n15 1 1 3\n16 0 1 3\n$EndNodes\n"
      "$Elements\n3\n1 3 2 1 1 1 2 3 4\n2 5 2 7 7 1 2 3 4 5 6 7 8\n"
      "3 5 2 7 7 9 10 11 12 13 14 15 16\n$EndElements\n");
  const Mesh mesh(path, 1);
  const auto text = free_with(mesh, {{"base", {true, true, true}}});
  EXPECT_NE(text.find("2 parts that share no node; this one is around (0.5, 0.5, 2.5)"),
            std::string::npos)
      << text;
}

}  // namespace
}  // namespace acopla::fem::test
