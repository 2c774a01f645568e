// Walls as a case writes them, and what it says to one that is written wrong.
#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>

#include "dem/wall/read.h"
#include "wall_scenes.h"

namespace acopla::dem::test::walls {
namespace {

// The wall of a case whose keys are `text`; everything in it must be used.
Wall wall_from(const std::string& text, int dimension) {
  const auto table = io::Table::from_text("[g.wall.w]\nmaterial = \"steel\"\n" + text, "test.toml");
  auto wall = read_wall(table.table("g").table("wall").table("w"), "w", {"glass", "steel"}, dimension);
  table.reject_unknown();
  return wall;
}

std::string complaint(const std::string& text, int dimension) {
  try {
    wall_from(text, dimension);
  } catch (const io::UserError& error) {
    return error.what();
  }
  return "accepted";
}

const std::string floor_2 = "line = [[0, 0], [1, 0], [1, 2]]\n", floor_3 = "plane = { point = [0, 0, 1], normal = [0, 0, 2] }\n";

TEST(WallCase, Shapes) {
  const auto plane = wall_from(floor_3, 3);
  EXPECT_TRUE(plane.is_plane);
  EXPECT_EQ(plane.material, 1);
  EXPECT_EQ(plane.name, "w");
  EXPECT_EQ(plane.point, Vec3(0, 0, 1));
  EXPECT_EQ(plane.normal, Vec3(0, 0, 1));
  EXPECT_EQ(plane.motion.kind(), Motion::Kind::fixed);
  EXPECT_EQ(wall_from("plane = { point = [0, 1], normal = [0, 1] }", 2).normal, Vec3(0, 1, 0));
  const auto line = wall_from(floor_2 + "closed = true\nglued = { diameter = 0.1 }", 2);
  EXPECT_EQ(line.line, (std::vector<Vec3>{{0, 0, 0}, {1, 0, 0}, {1, 2, 0}}));
  EXPECT_TRUE(line.closed);
  EXPECT_EQ(line.glued_diameter, 0.1);
  EXPECT_EQ(line.glued_spacing, 0.1);
  const auto path = std::filesystem::temp_directory_path() / "acopla_wall_case.stl";
  io::write_stl(path.string(), triangulated_floor(0.5, 2).mesh);
  const auto mesh = wall_from("mesh = \"" + path.string() + "\"\nglued = { diameter = 0.1, spacing = 0.2 }", 3);
  EXPECT_EQ(mesh.mesh.triangles.size(), 8u);
  EXPECT_EQ(mesh.glued_spacing, 0.2);
  std::filesystem::remove(path);
}

TEST(WallCase, Motions) {
  const auto motion = [](const std::string& text, int dimension) {
    return wall_from((dimension == 2 ? floor_2 : floor_3) + "[g.wall.w.motion]\n" + text, dimension).motion;
  };
  const auto slides = motion("kind = \"translation\"\nvelocity = [1, 2, 3]\nstart = 0.5\nstop = 2\nramp = 0.1", 3).at(1);
  EXPECT_LT((slides.displacement - 0.45 * Vec3(1, 2, 3)).norm(), 1e-15);
  const auto turns = motion("kind = \"rotation\"\ncentre = [1, 0]\nrpm = 60", 2);
  EXPECT_TRUE(turns.turns());
  EXPECT_NEAR(turns.at(0.25).angle, M_PI / 2, 1e-15);
  EXPECT_EQ(turns.axis(), Vec3::UnitZ());
  EXPECT_EQ(motion("kind = \"rotation\"\ncentre = [1, 0, 0]\naxis = [0, 2, 0]\nspeed = -3", 3).at(1).rate, -3);
  const auto shakes = motion("kind = \"vibration\"\ndirection = [0, 0, 2]\namplitude = 0.01\nfrequency = 5\nphase = 90", 3).at(0);
  EXPECT_LT((shakes.displacement - Vec3(0, 0, 0.01)).norm(), 1e-17);
  EXPECT_NEAR(motion("kind = \"vibration\"\ncentre = [0, 0]\nangle = 90\nfrequency = 1", 2).at(0.25).angle, M_PI / 2, 1e-15);
  const auto path = motion("kind = \"path\"\ntimes = [0, 1, 2]\ndisplacements = [[0, 0], [1, 0], [1, 1]]\nangles = [0, 90, 0]\ncentre = [0, 0]\n"
                           "interpolation = \"linear\"", 2).at(1.5);
  EXPECT_LT((path.displacement - Vec3(1, 0.5, 0)).norm(), 1e-16);
  EXPECT_NEAR(path.rate, -M_PI / 2, 1e-15);
  const auto servo = motion("kind = \"servo\"\ndirection = [0, 0, -2]\nforce = 10\nmass = 2\ndamping = 5\nmax_speed = 0.1\nstart = 0.5", 3).servo();
  EXPECT_EQ(servo.direction, Vec3(0, 0, -1));
  EXPECT_EQ(servo.force, 10);
  EXPECT_EQ(servo.mass, 2);
  EXPECT_EQ(servo.damping, 5);
  EXPECT_EQ(servo.gain, 0);
  EXPECT_EQ(servo.start, 0.5);
}

TEST(WallCase, MistakesAreLocatedAndNameTheirCure) {
  struct Mistake {
    int dimension;
    std::string text;
    const char *where, *says;
  };
  const std::string in_motion_2 = floor_2 + "[g.wall.w.motion]\n", in_motion_3 = floor_3 + "[g.wall.w.motion]\n";
  const std::vector<Mistake> mistakes{
      {3, "", "test.toml:1:", "exactly one of plane and mesh"},
      {2, "", "test.toml:1:", "exactly one of plane and line"},
      {3, "line = [[0, 0], [1, 0]]", "test.toml:3:", "line is for two dimensions. Use plane or mesh"},
      {2, "mesh = \"box.stl\"", "test.toml:3:", "mesh is for three dimensions. Use plane or line"},
      {2, "line = [[0, 0]]", "test.toml:3:", "two or more corners"},
      {2, "line = [[0, 0], [1, 0]]\nclosed = true", "test.toml:3:", "three or more corners"},
      {2, "line = [[0, 0], [1, 0], [1, 0]]", "test.toml:3:", "corner (1, 0) twice in a row. Remove one"},
      {2, "line = [[0, 0], [1, 0], [1, 1], [0, 0]]\nclosed = true", "test.toml:3:", "returns to its first corner by itself"},
      {3, "plane = { point = [0, 0, 0], normal = [0, 0, 0] }", "test.toml:3:", "normal has no length"},
      {3, floor_3 + "closed = true", "test.toml:4:", "closed belongs to a line"},
      {3, floor_3 + "glued = { diameter = 0.1 }", "test.toml:4:", "glued particles need a mesh to stand on"},
      {2, floor_2 + "glued = { diameter = 0 }", "test.toml:4:", "diameter"},
      {2, in_motion_2 + "kind = \"rotate\"", "test.toml:5:", "rotation"},
      {2, in_motion_2 + "kind = \"rotation\"\ncentre = [0, 0]", "test.toml:4:", "exactly one of rpm [1/min] and speed [rad/s]"},
      {2, in_motion_2 + "kind = \"rotation\"\ncentre = [0, 0]\nrpm = 3\naxis = [0, 0, 1]", "test.toml:8:", "axis is not wanted in two dimensions"},
      {3, in_motion_3 + "kind = \"rotation\"\ncentre = [0, 0, 0]\nrpm = 3\naxis = [0, 0, 0]", "test.toml:8:", "axis has no length"},
      {2, in_motion_2 + "kind = \"translation\"\nvelocity = [1, 0]\nstart = 2\nstop = 1", "test.toml:8:", "before start = 2 s"},
      {2, in_motion_2 + "kind = \"translation\"\nvelocity = [1, 0]\nramp = -1", "test.toml:7:", "ramp"},
      {2, in_motion_2 + "kind = \"translation\"\nvelocity = [1, 0]\nspeed = 1", "test.toml:7:", "speed"},
      {2, in_motion_2 + "kind = \"vibration\"\nfrequency = 3", "test.toml:4:", "exactly one of amplitude [m], with direction, and angle [degrees]"},
      {2, in_motion_2 + "kind = \"vibration\"\nfrequency = 3\namplitude = 1\ndirection = [0, 1]\nstop = 3", "test.toml:9:", "needs a ramp"},
      {2, in_motion_2 + "kind = \"path\"\ntimes = [0]", "test.toml:6:", "two or more times"},
      {2, in_motion_2 + "kind = \"path\"\ntimes = [0, 1, 1]", "test.toml:6:", "must ascend: 1 follows 1"},
      {2, in_motion_2 + "kind = \"path\"\ntimes = [0, 1]", "test.toml:4:", "needs displacements [m] or angles [degrees]"},
      {2, in_motion_2 + "kind = \"path\"\ntimes = [0, 1]\ndisplacements = [[0, 0]]", "test.toml:7:", "has 1 entries for 2 times"},
      {2, in_motion_2 + "kind = \"path\"\ntimes = [0, 1]\ndisplacements = [[0, 0], [0, 1]]\ncentre = [0, 0]", "test.toml:8:", "no effect without angles"},
      {2, in_motion_2 + "kind = \"servo\"\ndirection = [0, -1]\nforce = 10\nmax_speed = 1", "test.toml:4:", "exactly one of gain [m/(N s)] and mass [kg]"},
      {2, in_motion_2 + "kind = \"servo\"\ndirection = [0, -1]\nforce = -10\nmax_speed = 1\ngain = 1", "test.toml:7:", "force"},
      {2, in_motion_2 + "kind = \"servo\"\ndirection = [0, -1]\nforce = 10\nmax_speed = 1\ngain = 1\ndamping = 2", "test.toml:10:", "belongs to mass"},
      {2, in_motion_2 + "kind = \"servo\"\ndirection = [0, -1]\nforce = 10\ngain = 1", "test.toml:4:", "max_speed"}};
  for (const auto& mistake : mistakes) {
    const auto said = complaint(mistake.text, mistake.dimension);
    EXPECT_EQ(said.rfind(mistake.where, 0), 0u) << said << "\n  for " << mistake.text;
    EXPECT_NE(said.find(mistake.says), std::string::npos) << said << "\n  for " << mistake.text;
  }
}

}  // namespace
}  // namespace acopla::dem::test::walls
