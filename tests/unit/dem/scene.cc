// What a user may write wrong in a DEM table, and the sentence that answers.
#include <gtest/gtest.h>

#include "dem/explain.h"
#include "dem/feeding/insertion.h"
#include "scenes.h"

namespace acopla::dem::test {
namespace {

const std::string good = R"(dimension = 3
end = 1.0
gravity = [0, 0, -9.81]
[g]
solver = "dem"
[g.material.glass]
density = 2500
shear_modulus = 5e6
poisson = 0.25
[g.material.steel]
density = 7800
shear_modulus = 7e10
poisson = 0.3
[[g.contact]]
between = [["glass", "glass"], ["glass", "steel"]]
normal = "hertz"
tangential = "mindlin"
restitution = 0.3
friction = 0.5
[g.wall.floor]
plane = { point = [0, 0, 0], normal = [0, 0, 1] }
material = "steel"
[[g.insert]]
material = "glass"
diameter = 0.04
count = 20
region = { box = [[0, 0, 0], [1, 1, 1]] }
)";

std::string message_for(const std::string& from, const std::string& to) {
  std::string text = good;
  const auto at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  text.replace(at, from.size(), to);
  try {
    const auto root = io::Table::from_text(text, "case.toml");
    const auto scene = read_scene(root, "g");
    largest_step(scene, root.table("g"));
    insert_particles(scene, WallSet(scene.walls));
  } catch (const io::UserError& error) {
    return error.what();
  }
  return "nothing was wrong";
}

TEST(SceneErrors, GoodSceneIsGood) { EXPECT_EQ(message_for("dem", "dem"), "nothing was wrong"); }

TEST(SceneErrors, EachIsLocatedAndSaysHowToMendIt) {
  const std::vector<std::array<std::string, 3>> mistakes{
      {"poisson = 0.25", "poisson = 0.6", "case.toml:9:1: g.material.glass.poisson = 0.6 is outside (-1, 0.5)"},
      {"density = 2500", "densty = 2500", "Is it misspelt?"},
      {"friction = 0.5", "friction = 0.5\nfricton = 1", "Did you mean friction?"},
      {"density = 2500", "density = nan", "not a finite number"},
      {"density = 2500", "density = \"heavy\"", "must be a number, not text"},
      {"\"hertz\"", "\"hert\"", "Did you mean \"hertz\"?"},
      {", [\"glass\", \"steel\"]]", "]", "no contact law between glass and steel"},
      {"[\"glass\", \"steel\"]", "[\"glass\", \"stel\"]", "Did you mean steel?"},
      {"count = 20", "count = 200000", "Enlarge the region or lower the count"},
      {"count = 20", "count = 2.5", "must be an integer"},
      {"diameter = 0.04", "diameter = 4", "no whole sphere fits"},
      {"solver = \"dem\"", "solver = \"dem\"\nstep = 1", "above the critical step"},
      {"solver = \"dem\"", "solver = \"dem\"\nstep_fraction = 1.5", "above the critical step"},
      {"\"mindlin\"", "\"linear_slider\"", "hertz goes with none, mindlin"},
      {"normal = \"hertz\"", "normal = \"linear\"", "needs exactly one of stiffness"},
      {"shear_modulus = 5e6\n", "", "needs shear_modulus"},
      {"plane = { point = [0, 0, 0], normal = [0, 0, 1] }", "mesh = \"missing.stl\"", "does not exist"},
      {"normal = [0, 0, 1]", "normal = [0, 0, 0]", "has no length"},
      {"restitution = 0.3", "restitution = 0", "outside (0, 1]"}};
  for (const auto& [from, to, expected] : mistakes) {
    const auto message = message_for(from, to);
    EXPECT_NE(message.find(expected), std::string::npos) << to << "\n→ " << message;
    EXPECT_EQ(message.find("case.toml"), 0u) << message;
  }
}

TEST(Insertion, SpheresAreInsideTheRegionAndDoNotOverlap) {
  auto scene = read_scene(io::Table::from_text(good, "case.toml"), "g");
  scene.fillings[0].count = 500;
  scene.fillings[0].sizes = SizeDistribution::one(0.06, 3);
  const auto particles = insert_particles(scene, WallSet(scene.walls));
  ASSERT_EQ(particles.size(), 500u);
  for (std::size_t i = 0; i < particles.size(); ++i) {
    const Vec3 x = particles.position[i].vector();
    EXPECT_GE(x.minCoeff(), 0.03);
    EXPECT_LE(x.maxCoeff(), 0.97);
    for (std::size_t j = 0; j < i; ++j) EXPECT_GE((x - particles.position[j].vector()).norm(), 0.06);
  }
}

TEST(Insertion, SeedDecidesThePlaces) {
  auto scene = read_scene(io::Table::from_text(good, "case.toml"), "g");
  const WallSet walls(scene.walls);
  const auto first = insert_particles(scene, walls), again = insert_particles(scene, walls);
  EXPECT_EQ(first.position[7].vector(), again.position[7].vector());
  scene.seed = 2;
  EXPECT_NE(first.position[7].vector(), insert_particles(scene, walls).position[7].vector());
}

TEST(Explain, MeasuresASceneWhoseGluedParticlesReachIntoItsRegion) {
  // A regression: the lattice that the expected run time is measured on was laid across glued particles, which "pushed it through the wall".
  const auto root = io::Table::from_text(R"(dimension = 2
end = 1.0
gravity = [0, -9.81]
[g]
solver = "dem"
[g.material.m]
density = 1000
[[g.contact]]
between = [["m", "m"]]
normal = { law = "linear", stiffness = 1e6 }
restitution = 0.5
[g.wall.floor]
line = [[0, 0.6], [0, 0], [0.8, 0], [0.8, 0.6]]
glued = { diameter = 0.012 }
material = "m"
[[g.insert]]
material = "m"
diameter = 0.012
count = 100
region = { box = [[0, 0], [0.8, 0.6]] }
)", "case.toml");
  EXPECT_NE(explain(root, "g").find("expected run time"), std::string::npos);
}

TEST(SceneSet, SmoothSpheresStoreNoRotationAndNoHistory) {
  Laws smooth;
  smooth.tangential = "none";
  const auto without = engine_with(scene_of(smooth), {{Vec3::Zero()}})->costs();
  const auto with = engine_with(scene_of(hertz_mindlin), {{Vec3::Zero()}})->costs();
  EXPECT_EQ(with.bytes_per_particle - without.bytes_per_particle, 2 * sizeof(Record)  /* spin and torque */);
  EXPECT_EQ(with.bytes_per_contact - without.bytes_per_contact, 32u);
}

}  // namespace
}  // namespace acopla::dem::test
