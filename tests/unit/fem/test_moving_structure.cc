// A structure in motion as a participant of a coupling.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <map>

#include "fem/structure.h"
#include "gmsh_writer.h"
#include "tractions.h"

namespace acopla::fem::test {
namespace {

using protocol::Window;

constexpr double gravity = 9.81, density = 2000, step = 1e-4;

std::string case_of(const std::string& mesh, const std::string& more,
                    const std::string& supports = "[structure.fix.z0]\n",
                    const std::string& material = "young = 1e9\npoisson = 0.2\ndensity = 2000\n") {
  return "dimension = 3\n[structure]\nsolver = \"fem\"\nmesh = \"" + mesh +
         "\"\nanalysis = \"dynamic\"\n" + more + "[structure.material]\n" + material + supports;
}

class AMovingStructure : public testing::Test {
 protected:
  Structure make(const std::string& more = "",
                 const std::string& supports = "[structure.fix.z0]\n") const {
    return Structure(read_settings(
        io::Table::from_text(case_of(mesh_, more, supports), "case.toml"), "structure"));
  }
  static protocol::Run run(double weight = gravity) {
    protocol::Run result;
    result.tick = step;
    result.end = 10;
    result.window = 1;
    result.gravity[2] = -weight;
    result.uses = {{"z1", {"force"}, {"displacement", "velocity"}}};
    return result;
  }
  static Window window(int index) { return {index, index + 1, step * index, step}; }
  static std::map<std::string, double> quantities(const protocol::Advance& advance) {
    return {advance.quantities.begin(), advance.quantities.end()};
  }
  static std::vector<Vec3> pressure(const std::vector<protocol::Surface>& surfaces, double value) {
    return traction_loads(surfaces.at(0).mesh,
                          [&](const Vec3&, const Vec3& n) { return Vec3(-value * n); });
  }
  static std::string failure(const std::string& text) {
    try {
      Structure structure(read_settings(io::Table::from_text(text, "case.toml"), "structure"));
      structure.start(run());
    } catch (const io::UserError& error) {
      return error.what();
    }
    return "no error";
  }
  std::string mesh_ = write_block("block", {.size = {2, 1, 0.5}});
};

// In equilibrium with its weight nothing moves: what the static residual of 1e-14 of the stresses
// leaves, some 1e-12 of the velocity it would have in free fall after ten windows.
TEST_F(AMovingStructure, BeginsInEquilibriumWithItsWeight) {
  auto structure = make();
  structure.start(run());
  protocol::Advance last;
  for (int w = 0; w < 10; ++w) last = structure.advance(window(w), {});
  const auto found = quantities(last);
  EXPECT_LT(found.at("velocity.max"), 1e-10 * gravity * 10 * step);
  EXPECT_NEAR(found.at("reaction.z"), density * gravity, 1e-9 * density * gravity);
  EXPECT_NEAR(found.at("load.z"), -density * gravity, 1e-9 * density * gravity);
  EXPECT_GT(found.at("displacement.max"), 0);
  EXPECT_EQ(found.count("von_mises.max"), 0u);  // not asked for
}

// A scene pays for what a sudden force moves only where an explicit scheme asks. Held nodes have none.
TEST_F(AMovingStructure, KnowsWhatASuddenForceMovesWhereItIsAsked) {
  EXPECT_TRUE(make().start(run()).at(0).mass.empty());
  auto asked = run();
  asked.wants_mass = true;
  const auto surface = make("", "[structure.fix.x0]\n").start(asked).at(0);
  ASSERT_EQ(surface.mass.size(), surface.mesh.points.size());
  for (std::size_t n = 0; n < surface.mass.size(); ++n) {
    const bool held = surface.mesh.points[n][0] == 0;
    for (int d = 0; d < 3; ++d) EXPECT_EQ(surface.mass[n][d] > 0, !held) << n;
    EXPECT_LT(surface.mass[n].maxCoeff(), density);  // of the 1 m³
  }
}

TEST_F(AMovingStructure, FallsWhenNothingHoldsIt) {
  auto structure = make("start = \"rest\"\n", "");
  structure.start(run());
  protocol::Advance last;
  for (int w = 0; w < 10; ++w) last = structure.advance(window(w), {});
  for (const auto& v : last.fields.at(1).values)
    EXPECT_NEAR(v[2], -gravity * 10 * step, 1e-10 * gravity * 10 * step);
  for (const auto& u : last.fields.at(0).values)
    EXPECT_NEAR(u[2], -gravity * 50 * step * step, 1e-10 * gravity * 50 * step * step);
}

// The trapezoidal rule: displacement is the mean of the velocities times the step, to the round-off
// of its own sum.
TEST_F(AMovingStructure, SendsDisplacementAndVelocityOfItsSurfaces) {
  auto structure = make();
  const auto force = pressure(structure.start(run(0)), 1e4);
  double u = 0, v = 0;
  for (int w = 0; w < 10; ++w) {
    const auto advance = structure.advance(window(w), {{"z1", "force", force}});
    ASSERT_EQ(advance.fields.at(0).name, "displacement");
    ASSERT_EQ(advance.fields.at(1).name, "velocity");
    const double next_u = advance.fields[0].values.at(7)[2],
                 next_v = advance.fields[1].values.at(7)[2];
    EXPECT_NEAR(next_u - u, 0.5 * step * (v + next_v), 1e-15 + 1e-12 * std::abs(next_u));
    u = next_u;
    v = next_v;
    EXPECT_EQ(advance.steps, 1u);
  }
  EXPECT_LT(u, 0);
}

TEST_F(AMovingStructure, TakesStepsNoLongerThanTheCaseSays) {
  auto structure = make("step = 3e-5\n");
  structure.start(run());
  EXPECT_EQ(structure.advance(window(0), {}).steps, 4u);
  auto exact = make("step = 2.5e-5\n");
  exact.start(run());
  EXPECT_EQ(exact.advance(window(0), {}).steps, 4u);
}

// Rejected iterations leave no trace: the bits are those of a run that never had them.
TEST_F(AMovingStructure, ReturnsToASavedStateBitForBit) {
  for (const std::string scheme : {"", "generalised_alpha = { spectral_radius = 0.8 }\n",
                                   "newmark = { beta = 0.3, gamma = 0.55 }\n", "displacements = \"large\"\n"}) {
    const auto more = scheme + "rayleigh = { mass = 2, stiffness = 1e-5 }\nstep = 5e-5\n";
    const auto output =
        "[structure.fix.z0]\n[structure.load.x1]\npressure = 1e4\namplitude = [[0, 0], [4e-4, "
        "1]]\n[structure.output]\nenergy = true\n";
    auto straight = make(more, output), wavering = make(more, output);
    const auto force = pressure(straight.start(run()), 1e4);
    const auto other = pressure(wavering.start(run()), -3e5);
    for (int w = 0; w < 5; ++w) {
      wavering.save();
      for (int iteration = 0; iteration < 2; ++iteration) {
        wavering.advance(window(w), {{"z1", "force", other}});
        wavering.restore();
      }
      const auto a = straight.advance(window(w), {{"z1", "force", force}}),
                 b = wavering.advance(window(w), {{"z1", "force", force}});
      EXPECT_EQ(a.fields[0].values, b.fields[0].values);
      EXPECT_EQ(a.fields[1].values, b.fields[1].values);
      EXPECT_EQ(a.quantities, b.quantities);
    }
  }
}

// A checkpoint amid a motion, and another process of the same case that goes on from it: bit for bit what goes on without.
TEST_F(AMovingStructure, ResumesBitForBit) {
  const auto folder = std::filesystem::path(write_file("marker", "")).parent_path() / "checkpoint";
  std::filesystem::create_directories(folder);
  for (const std::string scheme : {"", "generalised_alpha = { spectral_radius = 0.8 }\n", "newmark = { beta = 0.3, gamma = 0.55 }\n",
                                   "displacements = \"large\"\n"}) {
    const auto more = scheme + "rayleigh = { mass = 2, stiffness = 1e-5 }\nstep = 5e-5\n";
    const auto output = "[structure.fix.z0]\n[structure.load.x1]\npressure = 1e4\namplitude = [[0, 0], [4e-4, 1]]\n[structure.output]\nenergy = true\n";
    auto straight = make(more, output), resumed = make(more, output);
    const auto force = pressure(straight.start(run()), 1e4);
    for (int w = 0; w < 3; ++w) straight.advance(window(w), {{"z1", "force", force}});
    straight.checkpoint(folder.string());
    auto again = run();
    again.resumes = true;
    resumed.start(again);
    resumed.resume(folder.string());
    for (int w = 3; w < 6; ++w) {
      const auto a = straight.advance(window(w), {{"z1", "force", force}}), b = resumed.advance(window(w), {{"z1", "force", force}});
      EXPECT_EQ(a.fields[0].values, b.fields[0].values) << scheme;
      EXPECT_EQ(a.fields[1].values, b.fields[1].values) << scheme;
      EXPECT_EQ(a.quantities, b.quantities) << scheme;
    }
  }
}

// Under large displacements it bends far and springs back: the balance of energy is to 1e-9, and what it turns with is not small.
TEST_F(AMovingStructure, SwingsThroughLargeDisplacements) {
  const auto text =
      "dimension = 2\n[structure]\nmesh = { bar = { size = [1, 0.02], cells = [16, 1] } }\nanalysis = \"dynamic\"\n"
      "displacements = \"large\"\nstart = \"rest\"\n[structure.material]\nyoung = 1e7\npoisson = 0.3\ndensity = 1000\nlaw = \"neo_hooke\"\n"
      "[structure.fix.x0]\n[structure.output]\nenergy = true\n";
  Structure structure(read_settings(io::Table::from_text(text, "case.toml"), "structure"));
  auto alone = run(0);
  alone.uses.clear();
  alone.gravity[1] = -gravity;
  structure.start(alone);
  double farthest = 0;
  for (int w = 0; w < 100; ++w) {
    const auto found = quantities(structure.advance({w, w + 1, 0.01 * w, 0.01}, {}));
    EXPECT_NEAR(found.at("energy.error"), 0, 1e-9 * 1000 * 0.02 * gravity);
    farthest = std::max(farthest, found.at("displacement.max"));
  }
  EXPECT_GT(farthest, 0.7);
  const auto lines = explain(read_settings(io::Table::from_text(text, "case.toml"), "structure"));
  EXPECT_NE(lines.find("dynamic geometrically nonlinear elasticity"), std::string::npos) << lines;
  EXPECT_NE(lines.find("energy and momentum kept"), std::string::npos) << lines;
}

// 1e-9 of the work: residuals of the solve, of some 1e-13 of the forces, times the displacements.
TEST_F(AMovingStructure, BalancesItsEnergy) {
  auto structure = make("rayleigh = { mass = 2, stiffness = 1e-5 }\n",
                        "[structure.fix.z0]\n[structure.output]\nenergy = true\n");
  const auto force = pressure(structure.start(run()), 1e5);
  for (int w = 0; w < 10; ++w) {
    const auto found = quantities(structure.advance(window(w), {{"z1", "force", force}}));
    EXPECT_NEAR(found.at("energy.error"), 0, 1e-9 * found.at("energy.work"));
    EXPECT_GT(found.at("energy.damping"), 0);
    EXPECT_GT(found.at("energy.kinetic"), 0);
  }
}

TEST_F(AMovingStructure, IsRefusedWithoutWhatMotionNeeds) {
  const auto expect = [&](const std::string& text, const std::vector<std::string>& parts) {
    const auto found = failure(text);
    for (const auto& part : parts) EXPECT_NE(found.find(part), std::string::npos) << found;
  };
  expect(case_of(mesh_, "", "[structure.fix.z0]\n", "young = 1e9\npoisson = 0.2\n"),
         {"case.toml:6:", "structure.material has no density"});
  expect(case_of(mesh_, "newmark = { beta = 0.1666, gamma = 0.5 }\n"),
         {"case.toml:6:", "structure.newmark has beta = 0.1666 below gamma / 2 = 0.25",
          "2 beta >= gamma >= 1/2"});
  expect(case_of(mesh_, "generalised_alpha = { spectral_radius = 1.2 }\n"),
         {"spectral_radius", "[0, 1]"});
  expect(case_of(mesh_, "newmark = { beta = 0.25 }\ngeneralised_alpha = { spectral_radius = 1 }\n"),
         {"are both given"});
  expect(case_of(mesh_, "rayleigh = { mass = -1 }\n"), {"structure.rayleigh.mass"});
  expect(case_of(mesh_, "step = 0\n"), {"structure.step"});
  expect(case_of(mesh_, "", ""),
         {"structure", "start", "leaves the structure free to", "use start = \"rest\""});
  auto text = case_of(mesh_, "step = 1\n");
  text.replace(text.find("dynamic"), 7, "static");
  expect(text, {"structure.step belongs to analysis = \"dynamic\""});
}

// Frequencies on request: a clamped block of 2 × 1 × 0.5 m has its shear mode along x first, above
// sqrt(G/ρ)/(4 h) of a layer less bending.
TEST_F(AMovingStructure, TellsItsNaturalFrequenciesAtTheEnd) {
  auto structure = make("", "[structure.fix.z0]\n[structure.output]\nfrequencies = 3\n");
  structure.start(run());
  structure.advance(window(0), {});
  std::map<std::string, double> found;
  for (const auto& [name, value] : structure.finish()) found[name] = value;
  const double layer = std::sqrt(1e9 / 2.4 / density) / (4 * 0.5);
  EXPECT_GT(found.at("frequency.1"), 0.5 * layer);
  EXPECT_LT(found.at("frequency.1"), layer);
  EXPECT_LE(found.at("frequency.1"), found.at("frequency.2"));
  EXPECT_LE(found.at("frequency.2"), found.at("frequency.3"));
  EXPECT_EQ(found.count("frequency.4"), 0u);
  const auto many =
      failure(case_of(mesh_, "", "[structure.fix.z0]\n[structure.output]\nfrequencies = 90\n"));
  EXPECT_NE(
      many.find(
          "structure.output.frequencies asks for more than a quarter of the 300 free unknowns"),
      std::string::npos)
      << many;
  const auto loose =
      failure(case_of(mesh_, "start = \"rest\"\n", "[structure.output]\nfrequencies = 1\n"));
  EXPECT_NE(loose.find("frequencies are asked of a structure that is free to"), std::string::npos)
      << loose;
}

TEST_F(AMovingStructure, IsExplained) {
  const auto text = case_of(mesh_, "generalised_alpha = { spectral_radius = 1 }\n");
  const auto lines = explain(read_settings(io::Table::from_text(text, "case.toml"), "structure"));
  for (const auto* part : {"dynamic linear elasticity", "mass 2000 kg",
                           "generalised-α, β = 0.25, γ = 0.5, α_m = 0.5, α_f = 0.5", "a step"})
    EXPECT_NE(lines.find(part), std::string::npos) << lines;
}

}  // namespace
}  // namespace acopla::fem::test
