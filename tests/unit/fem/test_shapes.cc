// Meshes that a case describes: what they measure, what their sides are called, what is refused.
#include "fem/shapes.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <numbers>

#include "fem/faces.h"
#include "fem/part.h"
#include "fem/picture.h"
#include "gmsh_writer.h"
#include "io/error.h"

namespace acopla::fem::test {
namespace {

using std::numbers::pi;

MeshChoice choose(const std::string& shape, int dimension) {
  const auto root = io::Table::from_text("[structure]\nmesh = { " + shape + " }\n", "case.toml");
  return read_mesh_choice(root.table("structure"), dimension);
}

Mesh make(const std::string& shape, int dimension, int degree = 2) {
  return {choose(shape, dimension).make(), degree};
}

/// Sizes of the mesh's sides.
std::map<std::string, double> sides(const Mesh& mesh) {
  std::map<std::string, double> result;
  for (const auto& group : mesh.groups())
    if (group.dimension == mesh.dimension() - 1)
      result[group.name] = measure(mesh, mesh.boundary(group.name));
  return result;
}

void expect_sides(const Mesh& mesh, const std::map<std::string, double>& exact,
                  double tolerance = 1e-12) {
  const auto found = sides(mesh);
  ASSERT_EQ(found.size(), exact.size());
  double whole = 0;
  for (const auto& [name, size] : exact) {
    EXPECT_NEAR(found.at(name), size, tolerance * size) << name;
    whole += size;
  }
  EXPECT_NEAR(measure(mesh, mesh.boundary()), whole, tolerance * whole);  // no face without a name
}

TEST(ABar, HasSixSidesAndTheVolumeOfItsSize) {
  for (const char* simplices : {"false", "true"}) {
    const auto mesh =
        make(std::string(
                 "bar = { size = [3, 2, 1], cells = [4, 2, 1], origin = [1, 1, 1], simplices = ") +
                 simplices + " }",
             3);
    EXPECT_NEAR(mesh.volume(), 6, 1e-13);
    expect_sides(mesh, {{"x0", 2}, {"x1", 2}, {"y0", 3}, {"y1", 3}, {"z0", 6}, {"z1", 6}});
    EXPECT_NEAR(mesh.points()[mesh.nearest_node({9, 9, 9})][0], 4, 1e-14);
    const auto flat = make(
        std::string("bar = { size = [3, 2], cells = [4, 2], simplices = ") + simplices + " }", 2);
    EXPECT_NEAR(flat.volume(), 6, 1e-13);
    expect_sides(flat, {{"x0", 2}, {"x1", 2}, {"y0", 3}, {"y1", 3}});
  }
}

TEST(APlate, HasATopABottomAndEdges) {
  expect_sides(make("plate = { size = [2, 1, 0.1], cells = [4, 2, 1] }", 3),
               {{"top", 2}, {"bottom", 2}, {"edges", 0.6}});
}

TEST(ABox, HasAnInsideOfItsSize) {
  const auto mesh = make("box = { inner = [1, 2, 3], wall = 0.1, cells = [2, 3, 4] }", 3);
  EXPECT_NEAR(mesh.volume(), 1.2 * 2.2 * 3.1 - 1 * 2 * 3, 1e-12);
  expect_sides(mesh, {{"inside", 1 * 2 + 2 * (1 + 2) * 3},
                      {"outside", 2 * (1.2 + 2.2) * 3.1},
                      {"base", 1.2 * 2.2},
                      {"rim", 1.2 * 2.2 - 2}});
  const auto flat = make("box = { inner = [1, 2], wall = 0.1, cells = [2, 3], wall_cells = 1 }", 2);
  EXPECT_NEAR(flat.volume(), 1.2 * 2.1 - 2, 1e-13);
  expect_sides(flat, {{"inside", 5}, {"outside", 4.2}, {"base", 1.2}, {"rim", 0.2}});
}

TEST(AnLBracket, HasTwoLegs) {
  const auto mesh = make("l_bracket = { legs = [3, 2], width = 0.5, depth = 1, cells = 2 }", 3);
  EXPECT_NEAR(mesh.volume(), 0.5 * (3 + 2 - 0.5), 1e-13);
  expect_sides(
      mesh,
      {{"x1", 0.5}, {"y1", 0.5}, {"outer", 5}, {"inner", 4}, {"front", 2.25}, {"back", 2.25}});
  EXPECT_NEAR(make("l_bracket = { legs = [3, 2], width = 0.5, cells = 2 }", 2).volume(), 2.25,
              1e-13);
}

// Edges of second order are parabolas through three points of the circle: the area's error falls
// with the fourth power of the angle, that of straight edges with the second.
TEST(AnAnnulus, IsCurvedToTheOrderOfItsCells) {
  const auto error = [](int around, int degree) {
    const auto mesh =
        make("annulus = { inner = 1, outer = 2, cells = [2, " + std::to_string(around) + "] }", 2,
             degree);
    return std::abs(mesh.volume() - 3 * pi);
  };
  EXPECT_NEAR(std::log2(error(12, 1) / error(24, 1)), 2, 0.05);
  EXPECT_NEAR(std::log2(error(12, 2) / error(24, 2)), 4, 0.05);
}

TEST(AnAnnulus, HasAnInsideAnOutsideAndAsASectorTwoEnds) {
  // 48 parabolas around: the error of order 4, 1e-7 and less
  expect_sides(make("annulus = { inner = 1, outer = 2, centre = [5, 3], cells = [2, 48] }", 2),
               {{"inside", 2 * pi}, {"outside", 4 * pi}}, 1e-6);
  expect_sides(make("annulus = { inner = 1, outer = 2, from = 0, to = 90, cells = [2, 12] }", 2),
               {{"inside", pi / 2}, {"outside", pi}, {"start", 1}, {"end", 1}}, 1e-6);
}

TEST(ACylinder, IsAnAnnulusWithAHeight) {
  const auto mesh = make("cylinder = { inner = 1, outer = 2, height = 3, cells = [1, 24, 2] }", 3);
  EXPECT_NEAR(mesh.volume(), 9 * pi, 1e-5 * 9 * pi);  // 24 parabolas around
  expect_sides(mesh, {{"inside", 6 * pi}, {"outside", 12 * pi}, {"z0", 3 * pi}, {"z1", 3 * pi}},
               1e-5);
}

// An arc takes the faces whose middles lie in it, ends included: of 30 around, with middles at 6°,
// 18°, …, those from 30° to 150° are 11; from 350° to 370°, past the x axis, two. `outside` is
// meant where there is such a group.
// A disc's area and its rim are those of the circle, to the error of parabolas through three points of arcs of 90°/n: of order 4. Of first order
// they are those of the polygon of 4 n corners.
TEST(ADisc, IsRoundToTheOrderOfItsCells) {
  const double radius = 1.5;
  std::vector<double> errors;
  for (const int n : {1, 2, 4}) {
    const auto text = "disc = { radius = 1.5, centre = [3, -1], cells = " + std::to_string(n) + " }";
    const Mesh mesh = make(text, 2, 2);
    EXPECT_EQ(mesh.cells(), static_cast<std::size_t>(n * n + 4 * n * ((n + 1) / 2)));
    EXPECT_EQ(mesh.boundary().size(), static_cast<std::size_t>(4 * n));
    EXPECT_EQ(mesh.boundary("outside").size(), static_cast<std::size_t>(4 * n));
    for (const auto& face : mesh.boundary("outside"))
      for (const auto node : face.used()) EXPECT_NEAR((mesh.points()[node] - Vec3(3, -1, 0)).norm(), radius, 1e-14);
    errors.push_back(std::abs(mesh.volume() - pi * radius * radius));
    EXPECT_NEAR(make(text, 2, 1).volume(), 0.5 * 4 * n * radius * radius * std::sin(pi / (2 * n)), 1e-13);
  }
  EXPECT_NEAR(std::log2(errors[0] / errors[1]), 4, 0.2);
  EXPECT_NEAR(std::log2(errors[1] / errors[2]), 4, 0.1);
}

TEST(ARod, IsADiscWithAHeight) {
  const Mesh mesh = make("rod = { radius = 0.5, height = 2, cells = [3, 4] }", 3, 2);
  EXPECT_EQ(mesh.cells(), (9u + 4 * 3 * 2) * 4);
  const double parabolas = 2e-4;  // their error through arcs of 30°
  EXPECT_NEAR(mesh.volume(), pi * 0.25 * 2, parabolas * pi * 0.25 * 2);
  EXPECT_NEAR(measure(mesh, mesh.boundary("z1")), pi * 0.25, parabolas * pi * 0.25);
  EXPECT_NEAR(measure(mesh, mesh.boundary("outside")), 2 * pi * 0.5 * 2, 1e-3);
  EXPECT_EQ(mesh.boundary().size(), mesh.boundary("outside").size() + mesh.boundary("z0").size() + mesh.boundary("z1").size());
}

TEST(AnArc, HoldsTheFacesWithTheirMiddlesInIt) {
  const auto mesh =
      make("annulus = { inner = 0.04, outer = 0.05, centre = [0.6, 0.3], cells = [1, 30] }", 2);
  const auto count = [&](const std::string& on) {
    const auto root = io::Table::from_text("[load]\non = { arc = " + on + " }\n", "case.toml");
    return read_part(root.table("load"), mesh.groups(), 2, 1).faces(mesh).size();
  };
  EXPECT_EQ(count("{ from = 30, to = 150 }"), 11u);
  EXPECT_EQ(count("{ from = 350, to = 370 }"), 2u);
  EXPECT_EQ(count("{ from = 0, to = 360 }"), 30u);
  EXPECT_EQ(count("{ from = 30, to = 150, of = \"inside\" }"), 11u);
  EXPECT_EQ(count("{ from = 80, to = 100, centre = [0.6, 0.2] }"),
            6u);  // 5 of the top, 1 of the bottom
  EXPECT_THROW(count("{ from = 150, to = 30 }"), io::UserError);
}

// The picture of a curved mesh has its middles on the circle: radii of 1, 1.5 and 2 and none in
// between.
TEST(AnAnnulus, IsDrawnRound) {
  const auto mesh = make("annulus = { inner = 1, outer = 2, cells = [1, 6] }", 2);
  const auto path = write_file("annulus.vtu", "");
  write_picture(path, mesh, mesh.zero(), Vector::Zero(static_cast<Eigen::Index>(mesh.nodes())));
  EXPECT_GT(std::filesystem::file_size(path), 500u);
  for (const auto& p : mesh.points()) EXPECT_NEAR(std::remainder(2 * p.norm(), 1), 0, 1e-14);
}

TEST(AShape, ThatCannotBeIsRefusedAtItsKey) {
  const auto expect = [](const std::string& shape, int dimension, const std::string& part) {
    std::string found = "no error";
    try {
      make(shape, dimension);
    } catch (const io::UserError& error) {
      found = error.what();
    }
    EXPECT_NE(found.find("case.toml:2:"), std::string::npos) << found;
    EXPECT_NE(found.find(part), std::string::npos) << found;
  };
  expect("baar = { size = [1, 1], cells = [1, 1] }", 2,
         "structure.mesh names no shape: give one of bar, plate");
  expect("bar = { size = [1, 1], cells = [1, 1] }, box = { }", 2, "box and bar are both given");
  expect("bar = { size = [1, 0], cells = [1, 1] }", 2, "lengths are positive");
  expect("bar = { size = [1, 1], cells = [1, 1.5] }", 2, "whole number of at least 1");
  expect("bar = { size = [1, 1], cells = [1, 1, 1] }", 2, "needs 2 whole numbers");
  expect("annulus = { inner = 2, outer = 1, cells = [1, 8] }", 2, "must be above `inner`");
  expect("annulus = { inner = 1, outer = 2, cells = [1, 2] }", 2, "three cells around");
  expect("annulus = { inner = 1, outer = 2, cells = [1, 8], from = 90, to = 0 }", 2,
         "must lie above `from`");
  expect("annulus = { inner = 1, outer = 2, cells = [1, 8] }", 3, "in 3D use a cylinder");
  expect("plate = { size = [1, 1], cells = [1, 1] }", 2, "in 2D a bar");
  expect("l_bracket = { legs = [1, 0.2], width = 0.5, cells = 1 }", 2, "each above the width");
}

}  // namespace
}  // namespace acopla::fem::test
