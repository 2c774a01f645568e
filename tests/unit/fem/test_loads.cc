// Loads and prescribed displacements: their resultants, and exact answers of bars.
#include "fem/loads.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "cells.h"
#include "fem/baseline.h"
#include "fem/faces.h"
#include "fem/model.h"
#include "fem/statics.h"
#include "fem/stress.h"
#include "gmsh_writer.h"

namespace acopla::fem::test {
namespace {

constexpr double young = 2e9;

std::string case_of(const std::string& mesh, const std::string& more, int degree = 2,
                    const std::string& material = "young = 2e9\npoisson = 0\n") {
  return "dimension = 3\n[structure]\nmesh = \"" + mesh + "\"\ndegree = " + std::to_string(degree) +
         "\n[structure.material]\n" + material + more;
}

Settings settings_of(const std::string& text) {
  return read_settings(io::Table::from_text(text, "case.toml"), "structure");
}

class LoadsOfABlock : public testing::TestWithParam<CellKind> {
 protected:
  /// 2 × 1 × 0.5 m.
  std::string mesh() const {
    const auto [tetrahedra, degree] = GetParam();
    return write_block("block",
                       {.size = {2, 1, 0.5}, .cells = {3, 2, 2}, .tetrahedra = tetrahedra});
  }
  Vector loads(const std::string& load, double time = 0) const {
    const auto settings =
        settings_of(case_of(mesh(), load + "[structure.fix.z0]\n", GetParam().degree));
    model_ = std::make_unique<Model>(settings, Vec3::Zero());
    return model_->loads.at(time);
  }
  Vec3 moment(const Vector& nodal) const {
    Vec3 sum = Vec3::Zero();
    for (std::size_t n = 0; n < model_->mesh.nodes(); ++n)
      sum += model_->mesh.points()[n].cross(value_at(nodal, n, 3));
    return sum;
  }
  mutable std::unique_ptr<Model> model_;
};
INSTANTIATE_TEST_SUITE_P(Cells, LoadsOfABlock, all_kinds(), name_of_kind);

// Sums of some 50 terms: round-off only.
void expect_vector(const Vec3& found, const Vec3& exact) {
  EXPECT_LT((found - exact).norm(), 1e-12 * exact.norm())
      << found.transpose() << " against " << exact.transpose();
}

TEST_P(LoadsOfABlock, OfPressurePushAgainstTheNormalInTheMiddleOfTheFace) {
  const auto nodal = loads("[structure.load.x1]\npressure = 3e3\n");
  const Vec3 force(-3e3 * 0.5, 0, 0);
  expect_vector(total(nodal, 3), force);
  expect_vector(moment(nodal), Vec3(2, 0.5, 0.25).cross(force));
}

TEST_P(LoadsOfABlock, OfTractionAreForcePerArea) {
  const auto nodal =
      loads("[structure.load.pull]\non = [\"x1\", \"y1\"]\ntraction = [1e3, 0, 2e3]\n");
  expect_vector(total(nodal, 3), Vec3(1e3, 0, 2e3) * (0.5 + 1.0));
}

TEST_P(LoadsOfABlock, OfAForceAreSpreadEvenly) {
  const auto nodal = loads("[structure.load.z1]\nforce = [0, 0, -700]\n");
  expect_vector(total(nodal, 3), Vec3(0, 0, -700));
  expect_vector(moment(nodal), Vec3(1, 0.5, 0.5).cross(Vec3(0, 0, -700)));
}

TEST_P(LoadsOfABlock, OfALineAreForcePerLength) {
  const auto nodal = loads(
      "[structure.load.ridge]\nline_force = [0, 0, -40]\n");  // the edge x = 2, z = 0.5, of 1 m
  expect_vector(total(nodal, 3), Vec3(0, 0, -40));
  expect_vector(moment(nodal), Vec3(2, 0.5, 0.5).cross(Vec3(0, 0, -40)));
}

TEST_P(LoadsOfABlock, OfAPointStandAtItsNode) {
  const auto named = loads("[structure.load.corner]\npoint_force = [1, 2, 3]\n");
  const auto node = model_->mesh.nearest_node({2, 1, 0.5});
  expect_vector(value_at(named, node, 3), Vec3(1, 2, 3));
  expect_vector(total(named, 3), Vec3(1, 2, 3));
  const auto near = loads("[structure.load.tip]\nat = [2.01, 1, 0.5]\npoint_force = [1, 2, 3]\n");
  EXPECT_EQ(near, named);
}

TEST_P(LoadsOfABlock, OfABoxActOnItsFacesAlone) {
  const auto nodal =
      loads("[structure.load.half]\non = { box = [[0, 0, 0.5], [2, 0.5, 0.5]] }\npressure = 10\n");
  expect_vector(total(nodal, 3), Vec3(0, 0, -10 * 2 * 0.5));
}

TEST_P(LoadsOfABlock, FollowRampsAndTables) {
  const std::string ramp = "[structure.load.x1]\npressure = -2\nramp = 0.5\n";
  for (const auto& [time, factor] :
       {std::pair{-1.0, 0.0}, {0.0, 0.0}, {0.125, 0.25}, {0.5, 1.0}, {7.0, 1.0}})
    EXPECT_NEAR(total(loads(ramp, time), 3)[0], 2 * 0.5 * factor, 1e-14);
  const std::string table =
      "[structure.load.x1]\npressure = -2\namplitude = [[1, 3], [2, -1], [4, 0]]\n";
  for (const auto& [time, factor] :
       {std::pair{0.0, 3.0}, {1.5, 1.0}, {2.0, -1.0}, {3.0, -0.5}, {9.0, 0.0}})
    EXPECT_NEAR(total(loads(table, time), 3)[0], 2 * 0.5 * factor, 1e-14);
}

// A weight is ρ g V; loads of the case come on top.
TEST(LoadsOfAStructure, AddUpWithItsWeight) {
  const auto settings = settings_of(
      case_of(write_block("block"), "[structure.load.z1]\npressure = 100\n[structure.fix.z0]\n", 2,
              "young = 1e9\npoisson = 0.2\ndensity = 50\n"));
  const Model model(settings, Vec3(0, 0, -10));
  expect_vector(total(model.loads.at(0), 3), Vec3(0, 0, -50 * 10.0 - 100));
}

TEST(AnAmplitude, IntegratesAndAveragesItselfExactly) {
  const Amplitude hat({{0, 0}, {1, 2}, {3, 0}});
  EXPECT_DOUBLE_EQ(hat.integral(1), 1);
  EXPECT_DOUBLE_EQ(hat.integral(2), 2.5);
  EXPECT_DOUBLE_EQ(hat.integral(5), 3);
  EXPECT_DOUBLE_EQ(hat.mean(0.5, 2), (2.5 - 0.25) / 1.5);
  EXPECT_DOUBLE_EQ(hat.rate(0.5), 2);
  EXPECT_DOUBLE_EQ(hat.rate(2), -1);
  EXPECT_EQ(hat.rate(3), 0);
}

// The two ends of a bar of ν = 0 pulled apart: u = x δ / L, and the reaction is E A δ / L.
TEST_P(LoadsOfABlock, OfAMovedEndAreTheBarsOwn) {
  const auto settings =
      settings_of(case_of(mesh(),
                          "[structure.fix.x0]\n[structure.move.x1]\ndisplacement = [2e-3, 0, 0]\n"
                          "amplitude = [[0, 0], [2, 1]]\n",
                          GetParam().degree));
  const Model model(settings, Vec3::Zero());
  Statics statics(model.mesh, model.materials, model.supports.fixed(), settings.solver);
  statics.prepare();
  Vector prescribed = model.mesh.zero();
  model.supports.place(1.0, prescribed);  // half of it
  const auto solution = statics.solve(model.mesh.zero(), {}, prescribed);
  for (std::size_t n = 0; n < model.mesh.nodes(); ++n)
    EXPECT_LT(
        (value_at(solution.displacement, n, 3) - Vec3(1e-3 * model.mesh.points()[n][0] / 2, 0, 0))
            .norm(),
        1e-15);
  double pull = 0;
  for (const auto node : nodes_of(model.mesh.boundary("x1")))
    pull += value_at(solution.reaction, node, 3)[0];
  EXPECT_NEAR(pull, young * 0.5 * 1e-3 / 2, 1e-10 * pull);
  EXPECT_LT(solution.total_reaction().norm(), 1e-10 * pull);
}

// Two halves in series: u(L) = F/A (L/2) (1/E₁ + 1/E₂), exact for ν = 0; mass is that of both.
TEST_P(LoadsOfABlock, StretchABarOfTwoMaterialsInSeries) {
  const auto [tetrahedra, degree] = GetParam();
  const auto path = write_block(
      "two",
      {.size = {2, 1, 0.5}, .cells = {4, 1, 1}, .tetrahedra = tetrahedra, .two_solids = true});
  const auto settings = settings_of(case_of(
      path,
      "[structure.material.solid]\nyoung = 2e9\npoisson = 0\ndensity = 1000\n"
      "[structure.material.right]\non = \"other\"\nyoung = 5e9\npoisson = 0\ndensity = 3000\n"
      "[structure.fix.x0]\n[structure.load.x1]\ntraction = [1e6, 0, 0]\n",
      degree, ""));
  const Model model(settings, Vec3::Zero());
  Statics statics(model.mesh, model.materials, model.supports.fixed(), settings.solver);
  statics.prepare();
  const auto u = statics.solve(model.loads.at(0)).displacement;
  const double exact = 1e6 * (1 / 2e9 + 1 / 5e9);
  for (const auto node : nodes_of(model.mesh.boundary("x1")))
    EXPECT_NEAR(value_at(u, node, 3)[0], exact, 1e-12 * exact);
  EXPECT_NEAR(total(weight_loads(model.mesh, model.materials, Vec3(1, 0, 0)), 3)[0],
              0.5 * (1000 + 3000), 1e-9);
}

class BadInput : public testing::Test {
 protected:
  std::string mesh_ = write_block("block", {.two_solids = true});
  void expect(const std::string& more, const std::vector<std::string>& parts,
              const std::string& material = "young = 2e9\npoisson = 0\n") const {
    std::string found = "no error";
    try {
      const auto settings = settings_of(case_of(mesh_, more, 2, material));
      const Model model(settings, Vec3::Zero());
    } catch (const io::UserError& error) {
      found = error.what();
    }
    for (const auto& part : parts) EXPECT_NE(found.find(part), std::string::npos) << found;
  }
};

TEST_F(BadInput, OfLoadsIsLocatedAndSaysWhatToDo) {
  const std::string fix = "[structure.fix.z0]\n";
  expect(fix + "[structure.load.x1]\n", {"case.toml:9:", "structure.load.x1 says no load"});
  expect(fix + "[structure.load.x1]\npressure = 1\nforce = [1, 0, 0]\n",
         {"case.toml:11:", "pressure are both given"});
  expect(fix + "[structure.load.top]\npressure = 1\n",
         {"structure.load.top is not in the mesh.", "x0, x1, y0"});
  expect(fix + "[structure.load.a]\non = \"solid\"\npressure = 1\n",
         {"names \"solid\", which is made of volumes; a surface is needed"});
  expect(fix + "[structure.load.a]\non = \"x1\"\nline_force = [1, 0, 0]\n",
         {"which is made of surfaces; a curve is needed"});
  expect(fix + "[structure.load.edge]\nline_force = [1, 0, 0]\n",
         {"structure.load.edge", "has no edges in the mesh"});
  expect(fix + "[structure.load.x1]\npressure = 1\namplitude = [[0, 0], [2, 1], [1, 0]]\n",
         {"case.toml:11:", "amplitude goes from t = 2 s to t = 1 s. Times must ascend"});
  expect(fix + "[structure.load.x1]\npressure = 1\nramp = 1\namplitude = [[0, 0]]\n",
         {"ramp and amplitude are both given"});
  expect(fix + "[structure.load.x1]\npressure = 1\nramp = 0\n", {"ramp"});
  expect(fix + "[structure.load.a]\nat = [50, 0, 0]\npoint_force = [1, 0, 0]\n",
         {"structure.load.a.at is 49 m away"});
  expect(fix + "[structure.load.a]\non = { box = [[5, 5, 5], [6, 6, 6]] }\npressure = 1\n",
         {"holds no face of the boundary"});
  expect(fix + "[structure.load.a]\non = { sphere = 1 }\npressure = 1\n", {"is a group's name"});
}

TEST_F(BadInput, OfSupportsIsLocatedAndSaysWhatToDo) {
  expect("[structure.fix.z0]\n[structure.move.x1]\ndisplacement = [1e-3, 0, 0]\n",
         {"structure.move.x1 contradicts structure.fix.z0: both prescribe the displacement along x "
          "at (1, ",
          "Leave that direction out"});
  // the same motion at another time is one, the same twice is none
  const std::string up = "[structure.move.z0]\ndisplacement = [0, 0, 1e-3]\nramp = 1\n";
  expect(up + "[structure.move.y0]\ndisplacement = [0, 0, 1e-3]\nramp = 2\n",
         {"structure.move.y0 contradicts structure.move.z0: both prescribe the displacement along z", "choose parts that share no node"});
  expect(up + "[structure.move.y0]\ndisplacement = [0, 0, 1e-3]\nramp = 1\n", {"no error"});
  const auto back = write_file("back.csv", "0 0\n2 1\n1 0\n");
  expect("[structure.move.z0]\nvelocity = [1, 0, 0]\nrecord = \"" + back + "\"\n",
         {"case.toml:10:", "structure.move.z0.record goes from t = 2 s to t = 1 s. Times must ascend"});
  // what both leave at zero is no contradiction
  expect(
      "[structure.fix.y0]\ndirections = [\"y\"]\n[structure.move.z0]\ndisplacement = [1e-3, 0, "
      "0]\n",
      {"no error"});
  expect("[structure.fix.z0]\n[structure.move.z1]\n", {"structure.move.z1 says no motion"});
  expect(
      "[structure.fix.z0]\n[structure.move.z1]\nvelocity = [0, 0, 1]\nrecord = \"nothing.txt\"\n",
      {"nothing.txt"});
  expect("[structure.move.z1]\ndisplacement = [0, 0, 1]\ndirections = [\"z\"]\n",
         {"structure.move leaves the structure free to turn about the axis along z"});
}

TEST_F(BadInput, OfMaterialsIsLocatedAndSaysWhatToDo) {
  const std::string fix = "[structure.fix.z0]\n", elastic = "young = 1e9\npoisson = 0.2\n";
  expect(fix + "[structure.material.solid]\n" + elastic,
         {"structure.material leaves 4 of 8 cells without one", "around (0.75,"}, "");
  expect(fix + "[structure.material.solid]\n" + elastic +
             "[structure.material.more]\non = \"solid\"\n" + elastic,
         {"structure.material.more shares cells with structure.material.solid"}, "");
  expect(fix + "[structure.material.sold]\n" + elastic,
         {"structure.material.sold is not in the mesh.", "Did you mean \"solid\"?"}, "");
  expect(fix, {"poisson", "nearly incompressible", "locking = \"b_bar\""},
         "young = 1e9\npoisson = 0.4999\n");
  expect(fix, {"case.toml:8:", "structure.material.density = -7850 is outside (0, inf)"}, elastic + "density = -7850\n");
}

// One square on the left, two of half its height on the right, which share its outer corners and not the middle.
TEST_F(BadInput, OfHangingNodesIsLocatedAndSaysWhatToDo) {
  const auto path = write_file("hanging.msh",
                               "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n1 1 \"left\"\n2 2 \"solid\"\n$EndPhysicalNames\n"
                               "$Nodes\n8\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n5 1 0.5 0\n6 2 0 0\n7 2 0.5 0\n8 2 1 0\n$EndNodes\n"
                               "$Elements\n4\n1 1 2 1 1 4 1\n2 3 2 2 1 1 2 3 4\n3 3 2 2 1 2 6 7 5\n4 3 2 2 1 5 7 8 3\n$EndElements\n");
  for (const int degree : {1, 2}) {
    const auto text = "dimension = 2\n[structure]\nmesh = \"" + path + "\"\ndegree = " + std::to_string(degree) +
                      "\n[structure.material]\nyoung = 1\npoisson = 0\n[structure.fix.left]\n";
    try {
      const Model model(read_settings(io::Table::from_text(text, "case.toml"), "structure"), Vec3::Zero());
      FAIL() << "no error";
    } catch (const io::UserError& error) {
      EXPECT_NE(std::string(error.what()).find("case.toml:3:"), std::string::npos) << error.what();
      EXPECT_NE(std::string(error.what()).find("structure.mesh has a hanging node at (1, 0.5, 0)"), std::string::npos) << error.what();
    }
  }
}

TEST_F(BadInput, OfLawsIsLocatedAndSaysWhatToDo) {
  const std::string fix = "[structure.fix.z0]\n", elastic = "young = 1e9\npoisson = 0.2\n";
  expect(fix, {"case.toml:8:", "structure.material.law belongs to displacements"}, elastic + "law = \"neo_hooke\"\n");
  expect(fix, {"structure.material.law", "neo_hooke"}, elastic + "law = \"neo_hook\"\n");
}

TEST_F(BadInput, OfFoundationsIsLocatedAndSaysWhatToDo) {
  expect("[structure.foundation.z0]\n", {"case.toml:8:", "stiffness"});
  expect("[structure.foundation.z0]\nstiffness = 0\n", {"case.toml:9:", "structure.foundation.z0.stiffness"});
  expect("[structure.foundation.base]\nstiffness = 1e6\n", {"structure.foundation.base is not in the mesh.", "x0, x1, y0"});
  // springs along the normal of a flat face leave the body to slide
  expect("[structure.foundation.z0]\nstiffness = 1e6\n", {"structure.foundation leaves the structure free to", "move along x"});
  expect("[structure.foundation.z0]\nstiffness = 1e6\ndirections = \"all\"\n", {"no error"});
}

// Velocities of a record in a file: a displacement by the trapezoidal rule, which is exact for it.
TEST(ARecord, OfVelocitiesIsIntegrated) {
  const auto file = write_file("quake.csv", "# t, v\n0, 0\n1, 2\n\n2, 0\n");
  const auto settings = settings_of(
      case_of(write_block("block"),
              "[structure.move.z0]\nvelocity = [1, 0, 0]\nrecord = \"" + file + "\"\n"));
  const auto& history = settings.supports.at(0).history;
  EXPECT_DOUBLE_EQ(history.displacement(1), 1);
  EXPECT_DOUBLE_EQ(history.displacement(2), 2);
  EXPECT_DOUBLE_EQ(history.velocity(1.5), 1);
  EXPECT_DOUBLE_EQ(history.acceleration(0.5), 2);
  const auto broken = write_file("broken.csv", "0 0\n1 zwei\n");
  try {
    settings_of(
        case_of(write_block("block"),
                "[structure.move.z0]\nvelocity = [1, 0, 0]\nrecord = \"" + broken + "\"\n"));
    FAIL();
  } catch (const io::UserError& error) {
    EXPECT_NE(std::string(error.what()).find("broken.csv:2:1: a line of a record has two numbers"),
              std::string::npos)
        << error.what();
  }
}

// Accelerations are integrated twice, exactly for what is linear between points: a(t) = 6 t gives v = 3 t², u = t³; after the record the
// velocity stays. Less its baseline, a record ends at rest where it began, and what is a straight line is gone.
TEST(ARecord, OfAccelerationsIsIntegratedTwice) {
  const MotionHistory raw{Amplitude({{0, 0}, {0.5, 3}, {2, 12}}), MotionHistory::Gives::accelerations};
  for (const double t : {0.25, 0.5, 1.0, 2.0}) {
    EXPECT_NEAR(raw.displacement(t), t * t * t, 1e-14 * 8);
    EXPECT_NEAR(raw.velocity(t), 3 * t * t, 1e-14 * 12);
    EXPECT_NEAR(raw.acceleration(t), 6 * t, 1e-14 * 12);
  }
  EXPECT_NEAR(raw.displacement(3), 8 + 12, 1e-13);
  EXPECT_NEAR(raw.velocity(3), 12, 1e-13);
  EXPECT_EQ(raw.acceleration(3), 0);
  EXPECT_EQ(raw.displacement(-1), 0);
  const auto nothing = correct_baseline(raw.amplitude);
  for (const auto& [t, a] : nothing.points()) EXPECT_NEAR(a, 0, 1e-13) << t;
  std::vector<std::pair<double, double>> shaken;
  for (int n = 0; n <= 400; ++n) shaken.emplace_back(1 + 0.01 * n, std::sin(7.0 * n * 0.01) + 0.02 + 0.01 * n * 0.01);
  const MotionHistory corrected{correct_baseline(Amplitude(shaken)), MotionHistory::Gives::accelerations};
  EXPECT_NEAR(corrected.velocity(5), 0, 1e-14);
  EXPECT_NEAR(corrected.displacement(5), 0, 1e-14);
  EXPECT_NEAR(corrected.displacement(9), 0, 1e-13);
  EXPECT_GT(std::abs(MotionHistory{Amplitude(shaken), MotionHistory::Gives::accelerations}.displacement(5)), 0.2);
}

// A shake that begins and ends at rest and returns, plus the drift of a velocity at the start and of a zero of the accelerations that was
// wrong by 0.02 and grew by 0.01 a second: the corrected record is the shake alone, to round-off.
TEST(ARecord, OfVelocitiesLosesAKnownDrift) {
  const auto shake = [](double t) { return std::sin(std::numbers::pi * t) * std::sin(2 * std::numbers::pi * t / 4); };
  std::vector<std::pair<double, double>> clean, drifting;
  for (int n = 0; n <= 400; ++n) {
    const double t = 0.01 * n;
    clean.emplace_back(1 + t, shake(t));
    drifting.emplace_back(1 + t, shake(t) + 0.3 + 0.02 * t + 0.005 * t * t);
  }
  ASSERT_NEAR(Amplitude(clean).integral(5), 0, 1e-14);
  const MotionHistory corrected{correct_velocities(Amplitude(drifting)), MotionHistory::Gives::velocities};
  for (const auto& [t, v] : clean) EXPECT_NEAR(corrected.velocity(t), v, 1e-13) << t;
  EXPECT_NEAR(corrected.displacement(5), 0, 1e-13);
  EXPECT_NEAR(corrected.displacement(9), 0, 1e-13);
  EXPECT_GT(MotionHistory({Amplitude(drifting), MotionHistory::Gives::velocities}).displacement(5), 1.2);
  // Nothing but drift leaves nothing, between the points of two as well.
  const auto nothing = correct_velocities(Amplitude({{0, 1}, {4, 3}}));
  for (const auto& [t, v] : nothing.points()) EXPECT_EQ(v, 0) << t;
}

TEST_F(BadInput, OfAccelerationsIsLocatedAndSaysWhatToDo) {
  expect("[structure.move.z0]\nacceleration = [1, 0, 0]\n", {"case.toml:9:", "structure.move.z0.acceleration needs a record"});
  expect("[structure.move.z0]\nacceleration = [1, 0, 0]\nvelocity = [1, 0, 0]\n", {"has both velocity and acceleration"});
  expect("[structure.move.z0]\nvelocity = [1, 0, 0]\nbaseline = \"raw\"\n", {"structure.move.z0.baseline belongs to a record of velocities or accelerations"});
  expect("[structure.move.z0]\ndisplacement = [1, 0, 0]\namplitude = [[0, 0], [1, 1]]\nbaseline = \"corrected\"\n", {"structure.move.z0.baseline belongs to a record"});
  expect("[structure.move.z0]\nvelocity = [1, 0, 0]\namplitude = [[0, 0], [1, 1], [2, 0]]\nbaseline = \"corrected\"\n", {"no error"});
  expect("[structure.move.z0]\nacceleration = [1, 0, 0]\namplitude = [[0, 0], [1, 1], [2, 0]]\n", {"no error"});
}

}  // namespace
}  // namespace acopla::fem::test
