// Laws from a user's library, built outside the tree against an installed prefix, run like those of the program.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "dem/laws.h"
#include "tests/unit/dem/kernel_properties.h"
#include "tests/unit/dem/scenes.h"

namespace acopla::dem::test {
namespace {

std::string library(const std::string& name) { return std::string(PLUGINS) + "/lib" + name + ".so"; }

dem::Laws with_library(const std::string& name) {
  auto laws = dem::Laws::built_in();
  laws.load(library(name));
  return laws;
}

std::string refusal(const std::string& path) {
  auto laws = dem::Laws::built_in();
  const auto before = laws.combinations().size();
  try {
    laws.load(path);
  } catch (const std::runtime_error& error) {
    EXPECT_EQ(laws.combinations().size(), before);  // all or nothing
    return error.what();
  }
  return "loaded";
}

TEST(LawLibrary, AddsItsLawsWithTheirNumbers) {
  const auto laws = with_library("walton_braun");
  ASSERT_NE(laws.normal("walton_braun"), nullptr);
  ASSERT_EQ(laws.normal("walton_braun")->fields.size(), 2u);
  EXPECT_STREQ(laws.normal("walton_braun")->fields[0].key, "loading_stiffness");
  EXPECT_TRUE(laws.has({"walton_braun", "linear_slider", "elastic_plastic"}));
  EXPECT_EQ(laws.tangentials_of("walton_braun"), (std::vector<std::string>{"none", "linear_slider"}));
}

TEST(LawLibrary, OfTwoLibrariesBothServe) {
  auto laws = with_library("walton_braun");
  laws.load(library("restated_linear"));
  EXPECT_TRUE(laws.has({"walton_braun", "linear_slider", "none"}));
  EXPECT_TRUE(laws.has({"restated_linear", "restated_slider", "elastic_plastic"}));
}

TEST(LawLibrary, ThatIsNoneIsRefusedWithASentence) {
  const auto missing = refusal("/nowhere/libmylaw.so");
  EXPECT_EQ(missing.substr(0, missing.find(':')), "cannot be loaded");
  const auto text = std::filesystem::temp_directory_path() / ("acopla-not-a-library-" + std::to_string(getpid()) + ".so");
  std::ofstream(text) << "not a library\n";
  EXPECT_NE(refusal(text).find("cannot be loaded"), std::string::npos);
  std::filesystem::remove(text);
  EXPECT_EQ(refusal(library("not_laws")), "is not a library of contact laws: it does not define ACOPLA_LAWS (see docs/laws.md)");
  EXPECT_EQ(refusal(library("other_version")), "was built for \"acopla laws 1, packs of four\", and this program is of \"" +
                                                   std::string(laws_version) + "\". Build it again with the Acopla that runs it.");
  EXPECT_EQ(refusal(library("no_laws")), "adds no laws: its ACOPLA_LAWS calls neither add nor add_with_rolling (see docs/laws.md)");
}

TEST(LawLibrary, MayNotTakeANameThatIsThere) {
  EXPECT_EQ(refusal(library("taken_name")), "adds the law hertz, and the law hertz is there already. Give it another name.");
  EXPECT_EQ(refusal(library("taken_combination")),
            "adds the combination hertz + mindlin + none, which is there already. Remove it from its ACOPLA_LAWS.");
  auto laws = with_library("walton_braun");
  EXPECT_THROW(laws.load(library("walton_braun")), std::runtime_error);
}

// A scene of one material with a law of a library; `contact` is the rest of its entry.
std::string scene_text(const std::string& plugin, const std::string& contact, int dimension = 3) {
  return fmt::format("dimension = {}\nend = 1.0\nplugins = [\"{}\"]\n[g]\nsolver = \"dem\"\nenergy = true\n[g.material.glass]\ndensity = {}\n"
                     "[[g.contact]]\nbetween = [[\"glass\", \"glass\"]]\n{}\n[[g.insert]]\nmaterial = \"glass\"\ndiameter = {}\ncount = 1\n"
                     "region = {{ box = [{}] }}\n",
                     dimension, plugin, density, contact, 2 * radius, dimension == 3 ? "[-50, -50, -50], [50, 50, 50]" : "[-50, -50], [50, 50]");
}
Scene scene_from(const std::string& text) { return read_scene(io::Table::from_text(text, "test.toml"), "g"); }

TEST(LawLibrary, ErrorsStandWhereTheCaseNamesIt) {
  const auto complaint = [](const std::string& text) -> std::string {
    try {
      scene_from(text);
    } catch (const io::UserError& error) {
      return error.what();
    }
    return "read";
  };
  const auto taken = complaint(scene_text(library("taken_name"), "normal = \"hertz\"\nrestitution = 0.5"));
  EXPECT_EQ(taken.substr(0, taken.find(' ')), "test.toml:3:1:");
  EXPECT_NE(taken.find("plugins names " + library("taken_name") + ", which adds the law hertz, and the law hertz is there already."),
            std::string::npos)
      << taken;
  const auto without = complaint(scene_text(library("walton_braun"), "normal = \"walton_braun\"\nrestitution = 0.5"));
  EXPECT_NE(without.find("needs loading_stiffness [N/m]"), std::string::npos) << without;
  const auto negative = complaint(scene_text(library("walton_braun"), "normal = { law = \"walton_braun\", loading_stiffness = -1 }\nrestitution = 0.5"));
  EXPECT_NE(negative.find("loading_stiffness"), std::string::npos) << negative;
}

// Two equal spheres meet head on at `speed`; returns the speed at which they part over that.
double restitution(const std::string& contact, double speed, double step, double* peak = nullptr) {
  const auto engine = engine_with(scene_from(scene_text(library("walton_braun"), contact)),
                                  {{Vec3(-1.0001 * radius, 0, 0), Vec3(speed / 2, 0, 0)}, {Vec3(1.0001 * radius, 0, 0), Vec3(-speed / 2, 0, 0)}});
  double deepest = 0;
  do {
    engine->advance(1, step);
    deepest = std::max(deepest, engine->worst_overlap() * radius);
  } while (velocity(*engine, 0)[0] > 0 || engine->contact_count() > 0);
  if (peak) *peak = deepest;
  EXPECT_LT(engine->energy().relative_drift, 2e-3);
  return (velocity(*engine, 1)[0] - velocity(*engine, 0)[0]) / speed;
}

TEST(WaltonBraun, ReturnsTheRestitutionOfTheCaseAtAnySpeed) {
  // Two straight lines: e = sqrt(k_1/k_2), peak overlap v sqrt(m*/k_1). In steps of 1/2000 of the loading time the turning points are met
  // to a share of a step: 1e-3.
  const double stiffness = 1e5, reduced = mass / 2, time = M_PI / 2 * std::sqrt(reduced / stiffness);
  for (const double e : {0.3, 0.7, 1.0})
    for (const double speed : {0.1, 2.0}) {
      double peak = 0;
      const auto contact = fmt::format("normal = {{ law = \"walton_braun\", loading_stiffness = {} }}\nrestitution = {}", stiffness, e);
      EXPECT_NEAR(restitution(contact, speed, time / 2000, &peak) / e, 1, 1e-3) << e << " at " << speed;
      EXPECT_NEAR(peak / (speed * std::sqrt(reduced / stiffness)), 1, 1e-6);
    }
}

TEST(WaltonBraun, HardeningMakesTheRestitutionFallWithTheSpeed) {
  // e(v) = sqrt(ω/(ω/e² + S v)), ω² = k_1/m*: what the area between the lines says.
  const double stiffness = 1e5, hardening = 2000, reduced = mass / 2, omega = std::sqrt(stiffness / reduced), e = 0.9;
  const auto contact = fmt::format("normal = {{ law = \"walton_braun\", loading_stiffness = {}, hardening = {} }}\nrestitution = {}", stiffness, hardening, e);
  for (const double speed : {0.1, 0.5, 2.0})
    EXPECT_NEAR(restitution(contact, speed, M_PI / 2 / omega / 2000) / std::sqrt(omega / (omega / (e * e) + hardening * speed)), 1, 1e-3) << speed;
}

TEST(LawLibrary, KernelsHaveThePropertiesOfBuiltInOnes) {
  auto laws = with_library("walton_braun");
  for (const auto& set : laws.combinations())
    if (set.normal == "walton_braun")
      for (const int dimension : {2, 3}) {
        SCOPED_TRACE(set.text() + " in " + std::to_string(dimension));
        auto pair = soft_glass();
        pair.laws = set;
        expect_kernel_properties(*laws.make(pair, dimension), dimension);
      }
}

// Six balls thrown at each other above a floor and against a wall.
std::unique_ptr<Engine> melee(const std::string& contact) {
  std::vector<Ball> balls;
  for (int n = 0; n < 6; ++n)
    balls.push_back({Vec3(0.03 * (n % 3), 0.025 * (n / 3), 0.011 + 0.001 * n), Vec3(1 - n, 0.3 * n - 0.5, -0.5), Vec3(10 * n, -20, 5 * n)});
  return engine_with(scene_from(scene_text(library("restated_linear"), contact)), balls,
                     {plane(Vec3::Zero(), Vec3::UnitZ()), plane(Vec3(-0.05, 0, 0), Vec3::UnitX())});
}

TEST(LawLibrary, ALawRestatedGivesTheSameTrajectoryToTheLastBit) {
  const auto entry = [](const char* normal, const char* tangential, const char* rolling) {
    return fmt::format("normal = {{ law = \"{}\", stiffness = 1e5 }}\ntangential = {{ law = \"{}\", ratio = 3.5 }}\nrolling = \"{}\"\n"
                       "restitution = 0.7\nfriction = 0.4{}", normal, tangential, rolling, std::string(rolling) == "none" ? "" : "\nrolling_friction = 0.05");
  };
  for (const char* rolling : {"none", "elastic_plastic"}) {
    const auto own = melee(entry("linear", "linear_slider", rolling)), theirs = melee(entry("restated_linear", "restated_slider", rolling));
    std::size_t met = 0;
    for (int n = 0; n < 200; ++n) {
      own->advance(10, 1e-5);
      theirs->advance(10, 1e-5);
      met += own->contact_count();
      for (std::uint32_t id = 0; id < 6; ++id) {
        ASSERT_EQ((position(*own, id) - position(*theirs, id)).norm(), 0) << n;
        ASSERT_EQ((velocity(*own, id) - velocity(*theirs, id)).norm(), 0) << n;
        ASSERT_EQ((spin(*own, id) - spin(*theirs, id)).norm(), 0) << n;
      }
    }
    EXPECT_GT(met, 100u);
  }
}

TEST(LawLibrary, StaysOpenWhileAnEngineRunsItsKernels) {
  // The scene that read the library is gone when the engine steps.
  const auto engine = melee("normal = { law = \"restated_linear\", stiffness = 1e5 }\nrestitution = 0.7");
  engine->advance(500, 1e-5);
  EXPECT_GT(engine->time(), 0);
}

}  // namespace
}  // namespace acopla::dem::test
