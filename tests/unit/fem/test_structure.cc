// The structure as a participant of a coupling.
#include "fem/structure.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>

#include "fem/distributed/team.h"
#include "gmsh_writer.h"
#include "io/series.h"
#include "tractions.h"

namespace acopla::fem::test {
namespace {

using protocol::Advance;
using protocol::Window;

constexpr double gravity = 9.81, density = 2000;

class AStructure : public testing::Test {
 protected:
  Structure make(const std::string& more = "", const std::string& fix = "[structure.fix.z0]\n") {
    const auto text = "dimension = 3\n[structure]\nsolver = \"fem\"\nmesh = \"" +
                      write_block("block", {.size = {2, 1, 0.5}}) +
                      "\"\n[structure.material]\nyoung = 1e9\npoisson = 0.2\n" + more + fix;
    return Structure(read_settings(io::Table::from_text(text, "case.toml"), "structure"));
  }
  static protocol::Run run(std::vector<std::string> sends = {"displacement", "velocity"}) {
    protocol::Run result;
    result.tick = 0.01;
    result.end = 10;
    result.window = 1;
    result.gravity[2] = -gravity;
    result.uses = {{"z1", {"force"}, std::move(sends)}};
    return result;
  }
  static Window window(int index) { return {index, index + 1, 0.01 * index, 0.01}; }
  static std::map<std::string, double> quantities(const Advance& advance) {
    return {advance.quantities.begin(), advance.quantities.end()};
  }
};

TEST_F(AStructure, CarriesItsWeightAndTheForcesItReceives) {
  auto structure = make("density = 2000\n");
  const auto surfaces = structure.start(run());
  ASSERT_EQ(surfaces.size(), 1u);
  EXPECT_EQ(surfaces[0].name, "z1");
  const auto pressure = traction_loads(surfaces[0].mesh, [](const Vec3&, const Vec3& n) {
    return Vec3(-1000 * n + Vec3(50, 0, 0));
  });
  const auto advance = structure.advance(window(0), {{"z1", "force", pressure}});
  const auto found = quantities(advance);
  const double weight = density * 1.0 * gravity, area = 2.0;
  // Force balance to 1e-10, as TEST(Balance, …) has it.
  EXPECT_NEAR(found.at("load.z"), -weight - 1000 * area, 1e-10 * weight);
  EXPECT_NEAR(found.at("load.x"), 50 * area, 1e-10 * weight);
  EXPECT_NEAR(found.at("reaction.z"), weight + 1000 * area, 1e-10 * weight);
  EXPECT_NEAR(found.at("reaction.x"), -50 * area, 1e-10 * weight);
  EXPECT_NEAR(found.at("reaction.y"), 0, 1e-10 * weight);
  EXPECT_GT(found.at("von_mises.max"), 0);

  ASSERT_EQ(advance.fields.size(), 2u);
  double largest = 0;
  for (const auto& u : advance.fields[0].values) {
    EXPECT_LT(u[2], 0);
    largest = std::max(largest, u.norm());
  }
  EXPECT_EQ(advance.fields[0].name, "displacement");
  // The same three squares, added in another order.
  EXPECT_LE(largest, found.at("displacement.max") * (1 + 1e-15));
  EXPECT_EQ(advance.fields[1].name, "velocity");
  for (const auto& v : advance.fields[1].values) EXPECT_EQ(v.norm(), 0);
}

TEST_F(AStructure, HasNoWeightWithoutADensity) {
  auto structure = make();
  structure.start(run());
  const auto found = quantities(structure.advance(window(0), {}));
  EXPECT_EQ(found.at("reaction.z"), 0);
  EXPECT_EQ(found.at("displacement.max"), 0);
}

TEST_F(AStructure, SendsOnlyTheFieldsThatWereAskedFor) {
  auto structure = make();
  structure.start(run({}));
  EXPECT_TRUE(structure.advance(window(0), {}).fields.empty());
}

TEST_F(AStructure, LeftFreeToMoveIsRefusedWithTheMotionsNamed) {
  auto structure = make("", "[structure.fix.z0]\ndirections = [\"z\"]\n");
  try {
    structure.start(run());
    FAIL();
  } catch (const io::UserError& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find("case.toml:"), std::string::npos) << text;
    EXPECT_NE(text.find("structure.fix leaves the structure free to turn about the axis along z "
                        "through (1, 0.5, 0), move along x, move along y."),
              std::string::npos)
        << text;
  }
}

// On request: a bar stretched along x between a fixed and a moved end. Stress σ = E ε of ν = 0,
// nothing else; reactions at the two ends are opposite.
TEST_F(AStructure, ReportsPointsAndTheReactionOfEachSupport) {
  const auto text =
      "dimension = 3\n[structure]\nmesh = { bar = { size = [2, 1, 0.5], cells = [4, 2, 2] } "
      "}\n[structure.material]\nyoung = 1e9\n"
      "poisson = 0\n[structure.fix.x0]\n[structure.move.x1]\ndisplacement = [1e-3, 0, "
      "0]\n[structure.output]\nreactions = true\n"
      "[structure.output.point.middle]\nat = [1, 0.5, 0.25]\nstress = "
      "true\n[structure.output.point.end]\nat = [2, 0, 0]\n";
  Structure structure(read_settings(io::Table::from_text(text, "case.toml"), "structure"));
  protocol::Run alone = run();
  alone.uses.clear();
  structure.start(alone);
  const auto found = quantities(structure.advance(window(0), {}));
  const double stress = 1e9 * 0.5e-3;
  EXPECT_NEAR(found.at("middle.displacement.x"), 0.5e-3, 1e-15);
  EXPECT_NEAR(found.at("end.displacement.x"), 1e-3, 1e-15);
  EXPECT_EQ(found.count("end.stress.xx"), 0u);
  EXPECT_NEAR(found.at("middle.stress.xx"), stress, 1e-10 * stress);
  EXPECT_NEAR(found.at("middle.stress.xy"), 0, 1e-10 * stress);
  EXPECT_NEAR(found.at("middle.principal.1"), stress, 1e-10 * stress);
  EXPECT_NEAR(found.at("middle.principal.3"), 0, 1e-10 * stress);
  EXPECT_NEAR(found.at("middle.von_mises"), stress, 1e-10 * stress);
  EXPECT_NEAR(found.at("x0.reaction.x"), -stress * 0.5, 1e-10 * stress);
  EXPECT_NEAR(found.at("x1.reaction.x"), stress * 0.5, 1e-10 * stress);
  EXPECT_NEAR(found.at("reaction.x"), 0, 1e-10 * stress);
}

// Springs under a block carry its weight, and count with the reactions.
// Equilibrium of moments: about any axis the supports turn the body back by what the loads turn it. The weight of 2 m³ at the middle of the
// block, a received pressure of the same resultant line, and a point force at the corner (2, 1, 0.5): about y through (0, 0, 0), z × … by hand.
TEST_F(AStructure, ReportsTorquesAboutAxes) {
  auto structure = make("density = 2000\n[structure.load.corner]\npoint_force = [0, 0, -500]\n",
                        "[structure.fix.z0]\n[structure.output.torque.about_y]\naxis = [0, 2, 0]\n"
                        "[structure.output.torque.tilted]\nabout = [0.3, -1, 2]\naxis = [1, 2, -1]\n");
  const auto surfaces = structure.start(run());
  const auto pressure = traction_loads(surfaces[0].mesh, [](const Vec3&, const Vec3& n) { return Vec3(-1000 * n); });
  const auto found = quantities(structure.advance(window(0), {{"z1", "force", pressure}}));
  const double exact = density * 1.0 * gravity * 1.0 + 1000 * 2 * 1.0 + 500 * 2;  // −z forces turn by +x F about y
  EXPECT_NEAR(found.at("about_y.torque.load"), exact, 1e-10 * exact);
  EXPECT_NEAR(found.at("about_y.torque.reaction"), -exact, 1e-9 * exact);
  EXPECT_NEAR(found.at("tilted.torque.reaction"), -found.at("tilted.torque.load"), 1e-9 * exact);
  EXPECT_GT(std::abs(found.at("tilted.torque.load")), 0.01 * exact);
}

TEST_F(AStructure, ReactsWithItsFoundation) {
  auto structure = make("density = 2000\n", "[structure.foundation.z0]\nstiffness = 1e6\ndirections = \"all\"\n");
  protocol::Run alone = run();
  alone.uses.clear();
  structure.start(alone);
  const auto found = quantities(structure.advance(window(0), {}));
  const double weight = density * gravity * 2 * 1 * 0.5;
  EXPECT_NEAR(found.at("load.z"), -weight, 1e-12 * weight);
  EXPECT_NEAR(found.at("reaction.z"), weight, 1e-11 * weight);
  EXPECT_NEAR(found.at("reaction.x"), 0, 1e-11 * weight);
}

// A block some hundred thousand times stiffer than its foundation: H along x on its top, 0.5 above its base, turns it by θ = H/2 / (k b L³/12) about
// the middle of the base, and moves it by H/(k A) there. Its springs turn it back by k b L³/12 θ; about an axis 2 above the base, by what H has there.
TEST_F(AStructure, StandsRigidOnItsFoundationUnderAMoment) {
  constexpr double k = 1e4, shear = 30, force = 2 * shear, moment = 0.5 * force, inertia = 2. / 3;
  auto structure = make("", "[structure.foundation.z0]\nstiffness = 1e4\ndirections = \"all\"\n[structure.load.z1]\ntraction = [30, 0, 0]\n"
                            "[structure.output.torque.base]\naxis = [0, 1, 0]\n"
                            "[structure.output.torque.above]\nabout = [5, 0, 2]\naxis = [0, 3, 0]\n"
                            "[structure.output.point.heel]\nat = [0, 0, 0]\n[structure.output.point.toe]\nat = [2, 1, 0]\n");
  auto alone = run();
  alone.uses.clear();
  structure.start(alone);
  const auto found = quantities(structure.advance(window(0), {}));
  const double turned = (found.at("heel.displacement.z") - found.at("toe.displacement.z")) / 2;
  EXPECT_NEAR(turned, moment / (k * inertia), 3e-5 * turned);
  EXPECT_NEAR(found.at("toe.displacement.x"), force / (k * 2), 3e-5 * force / (k * 2));
  EXPECT_NEAR(found.at("base.torque.reaction"), -k * inertia * turned, 3e-5 * moment);
  EXPECT_NEAR(found.at("base.torque.reaction"), -moment, 1e-8 * moment);
  EXPECT_NEAR(found.at("base.torque.load"), moment, 1e-12 * moment);
  EXPECT_NEAR(found.at("above.torque.reaction"), 1.5 * force, 1e-8 * force);
  EXPECT_NEAR(found.at("above.torque.load"), -1.5 * force, 1e-12 * force);
}

// Springs along the normals of two sides, and a support across them: together they turn the block back by what its loads turn it, about any axis.
TEST_F(AStructure, IsTurnedBackBySupportsAndFoundationsTogether) {
  auto structure = make("", "[structure.foundation.z0]\nstiffness = 1e7\n[structure.foundation.x0]\nstiffness = 3e7\n[structure.fix.y0]\ndirections = [\"y\"]\n"
                            "[structure.load.z1]\ntraction = [30, 20, -10]\n[structure.output]\nreactions = true\n"
                            "[structure.output.torque.tilted]\nabout = [0.3, -1, 2]\naxis = [1, 2, -1]\n");
  auto alone = run();
  alone.uses.clear();
  structure.start(alone);
  const auto found = quantities(structure.advance(window(0), {}));
  // H = (60, 40, −20) N at (1, 0.5, 0.5): (0.7, 1.5, −1.5) × H = (30, −76, −62) N m, along (1, 2, −1)/√6.
  const double exact = (30 - 2 * 76 + 62) / std::sqrt(6.0);
  EXPECT_NEAR(found.at("tilted.torque.load"), exact, 1e-10 * std::abs(exact));
  EXPECT_NEAR(found.at("tilted.torque.reaction"), -exact, 1e-9 * std::abs(exact));
  EXPECT_NEAR(found.at("y0.reaction.y"), -40, 1e-8);
  EXPECT_NEAR(found.at("y0.reaction.x"), 0, 1e-12);  // the springs' forces are not the support's
}

TEST_F(AStructure, IsTurnedBackByItsFoundationIn2D) {
  const std::string text =
      "dimension = 2\n[structure]\nmesh = { bar = { size = [2, 1], cells = [4, 2] } }\nplane = \"stress\"\nthickness = 0.25\n"
      "[structure.material]\nyoung = 1e9\npoisson = 0.2\n[structure.foundation.y0]\nstiffness = 1e6\ndirections = \"all\"\n"
      "[structure.load.y1]\ntraction = [10, 0]\n[structure.output.torque.heel]\n";
  Structure structure(read_settings(io::Table::from_text(text, "case.toml"), "structure"));
  auto alone = run();
  alone.uses.clear();
  structure.start(alone);
  const auto found = quantities(structure.advance(window(0), {}));
  EXPECT_NEAR(found.at("heel.torque.load"), -5, 1e-12);  // 10 N/m² on 2 m of 0.25 m depth, 1 above the base
  EXPECT_NEAR(found.at("heel.torque.reaction"), 5, 1e-9);
}

// Large displacements: a slender strip under P L²/(E I) = 10 bends to 0.810609 L (Mattiasson 1981),
// whether in one window or in four, after an iteration that was rejected; small displacements would
// say 3.33 L.
TEST_F(AStructure, BendsFarWhenDisplacementsAreLarge) {
  const std::string text =
      "dimension = 2\n[structure]\nmesh = { bar = { size = [1, 0.01], cells = [30, 1] } "
      "}\ndisplacements = \"large\"\nplane = \"stress\"\n"
      "[structure.material]\nyoung = 1.2e9\npoisson = "
      "0\n[structure.fix.x0]\n[structure.load.x1]\nforce = [0, -1000]\nramp = 0.04\n"
      "[structure.output.point.tip]\nat = [1, 0.005]\n";
  protocol::Run alone = run();
  alone.uses.clear();
  std::vector<double> tips;
  for (const int windows : {1, 4}) {
    Structure structure(read_settings(io::Table::from_text(text, "case.toml"), "structure"));
    structure.start(alone);
    protocol::Advance last;
    for (int w = 0; w < windows; ++w) {
      structure.save();
      structure.advance({w, w + 1, 0.0, 0.01}, {});
      structure.restore();
      const double length = 0.04 / windows;
      last = structure.advance({w, w + 1, w * length, length}, {});
    }
    const auto found = quantities(last);
    tips.push_back(found.at("tip.displacement.y"));
    EXPECT_NEAR(tips.back(), -0.810609, 1e-3);
    EXPECT_NEAR(found.at("reaction.y"), 1000, 1e-5);
    EXPECT_GT(last.steps, 1u);
  }
  EXPECT_NEAR(tips[0], tips[1], 1e-8);
}

TEST_F(AStructure, RefusesSurfacesAndFieldsItDoesNotHave) {
  auto missing = run();
  missing.uses[0].surface = "inside";
  EXPECT_THROW(make().start(missing), io::UserError);
  EXPECT_THROW(make().start(run({"temperature"})), io::UserError);
  auto structure = make();
  structure.start(run());
  EXPECT_THROW(structure.advance(window(0), {{"x1", "force", {}}}), std::runtime_error);
  EXPECT_THROW(structure.advance(window(0), {{"z1", "force", {Vec3(1, 0, 0)}}}),
               std::runtime_error);
}

TEST_F(AStructure, ReportsWhatItCost) {
  auto structure = make();
  structure.start(run());
  structure.advance(window(0), {});
  std::map<std::string, double> cost;
  for (const auto& [name, value] : structure.finish()) cost[name] = value;
  EXPECT_EQ(cost.at("dofs"), 3 * 5 * 5 * 5);
  EXPECT_GT(cost.at("factor.bytes"), 0);
  for (const auto* name : {"seconds.setup", "seconds.factor", "seconds.solve", "residual"})
    EXPECT_GE(cost.at(name), 0) << name;
}

class Pictures : public AStructure {
 protected:
  Pictures() {
    folder_ = std::filesystem::path(write_file("marker", "")).parent_path() / "results";
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  protocol::Run drawing() const {
    auto result = run();
    result.results = folder_.string();
    return result;
  }
  int count() const {
    int files = 0;
    for (const auto& entry : std::filesystem::directory_iterator(folder_))
      files += entry.path().extension() == ".vtu";
    return files;
  }
  std::filesystem::path folder_;
};

TEST_F(Pictures, AreOfTheLastWindowUnlessTheCaseSaysHowOften) {
  auto structure = make();
  structure.start(drawing());
  for (int w = 0; w < 10; ++w) structure.advance(window(w), {});
  EXPECT_EQ(count(), 0);
  structure.finish();
  EXPECT_EQ(count(), 1);
  EXPECT_TRUE(std::filesystem::exists(folder_ / "structure_0001.vtu"));
  std::ifstream series(folder_ / "structure.pvd");
  const std::string text(std::istreambuf_iterator<char>(series), {});
  EXPECT_NE(text.find("structure_0001.vtu"), std::string::npos) << text;
}

TEST_F(Pictures, ComeAsOftenAsTheCaseSays) {
  auto structure = make("[structure.output]\nevery = 0.03\n");
  structure.start(drawing());
  for (int w = 0; w < 10; ++w) structure.advance(window(w), {});
  structure.finish();
  EXPECT_EQ(count(), 4);  // at 0.03, 0.06, 0.09 and the end
}

TEST_F(Pictures, OfRejectedIterationsAreNotKept) {
  auto structure = make("[structure.output]\nevery = 0.01\n");
  structure.start(drawing());
  structure.save();
  for (int iteration = 0; iteration < 3; ++iteration) {
    structure.restore();
    structure.advance(window(0), {});
  }
  structure.save();
  EXPECT_EQ(count(), 1);
  structure.finish();
  EXPECT_EQ(count(), 1);
}

// In one file beside or instead of them: the nodal fields at the times of the pictures, and after a resumption the rows until then.
TEST_F(Pictures, ComeAsRowsOfNumbersOnRequest) {
  const std::string output = "[structure.load.x1]\npressure = 1e5\namplitude = [[0, 0], [1, 1]]\n[structure.output]\nvtu = false\nhdf5 = true\nevery = 0.02\n";
  const auto checkpoint = folder_.parent_path() / "checkpoint";
  std::filesystem::create_directories(checkpoint);
  auto structure = make(output);
  const auto surfaces = structure.start(drawing());
  std::vector<std::vector<Vec3>> sent;
  for (int w = 0; w < 6; ++w) {
    sent.push_back(structure.advance(window(w), {}).fields[0].values);
    if (w == 3) structure.checkpoint(checkpoint.string());
  }
  structure.finish();
  EXPECT_EQ(count(), 0);
  const auto check = [&] {
    const io::SeriesReader file((folder_ / "structure.h5").string());
    ASSERT_EQ(file.windows(), 3u);
    const auto mesh = file.surface("mesh");
    for (std::size_t row = 0; row < 3; ++row) {
      EXPECT_NEAR(file.window(row).second, 0.02 * static_cast<double>(row + 1), 1e-12);
      const auto moved = file.field("mesh", "displacement", row);
      for (std::size_t i = 0; i < surfaces[0].mesh.points.size(); ++i) {
        const auto& p = surfaces[0].mesh.points[i];
        const auto at = std::find(mesh.points.begin(), mesh.points.end(), p) - mesh.points.begin();
        EXPECT_EQ(moved.at(static_cast<std::size_t>(at)), sent[2 * row + 1][i]);
      }
      const auto principal = file.field("mesh", "principal_stress", row);
      EXPECT_LT(std::min_element(principal.begin(), principal.end(), [](const Vec3& a, const Vec3& b) { return a[2] < b[2]; })->z(), 0);
    }
  };
  check();
  auto resumed = make(output);
  auto again = drawing();
  again.resumes = true;
  resumed.start(again);
  resumed.resume(checkpoint.string());
  for (int w = 4; w < 6; ++w) resumed.advance(window(w), {});
  resumed.finish();
  check();
}

// MPI is not started to ask.
TEST(ATeam, IsCountedByTheEnvironment) {
  EXPECT_EQ(Team::started(), 1);
  setenv("OMPI_COMM_WORLD_SIZE", "2", 1);
  EXPECT_EQ(Team::started(), 2);
  unsetenv("OMPI_COMM_WORLD_SIZE");
}

TEST_F(Pictures, CanBeTurnedOff) {
  auto structure = make("[structure.output]\nvtu = false\n");
  structure.start(drawing());
  structure.advance(window(0), {});
  structure.finish();
  EXPECT_EQ(count(), 0);
}

TEST(Explanation, SaysWhatWillRun) {
  const auto text = "dimension = 3\n[structure]\nmesh = \"" + write_block("block") +
                    "\"\n[structure.material]\nyoung = 1e9\npoisson = 0.2\n[structure.fix.z0]\n";
  const auto lines = explain(read_settings(io::Table::from_text(text, "case.toml"), "structure"));
  for (const auto* part : {"8 hexahedra of degree 2", "125 nodes, 375 unknowns (75 held)",
                           "surfaces of the mesh: x0, x1", "no density, so no weight",
                           "direct (Cholesky, factored once)", "a window"})
    EXPECT_NE(lines.find(part), std::string::npos) << lines;
  EXPECT_EQ(lines.find("warning"), std::string::npos) << lines;
}

TEST(Explanation, WarnsOfAMeshInMillimetres) {
  const std::string text =
      "dimension = 2\n[structure]\nmesh = { bar = { size = [2000, 100], cells = [2, 1] } }\n"
      "[structure.material]\nyoung = 1e9\npoisson = 0.2\n[structure.fix.x0]\n";
  const auto lines = explain(read_settings(io::Table::from_text(text, "case.toml"), "structure"));
  EXPECT_NE(lines.find("warning: the mesh is 2002 m large. Lengths are metres"), std::string::npos)
      << lines;
}

// A run says it too, in the log of the structure, and goes on.
TEST_F(AStructure, WarnsOfAMeshInMillimetres) {
  const auto text =
      "dimension = 2\n[structure]\nmesh = { bar = { size = [2000, 100], cells = [2, 1] } }\n"
      "[structure.material]\nyoung = 1e9\npoisson = 0.2\n[structure.fix.x0]\n";
  Structure structure(read_settings(io::Table::from_text(text, "case.toml"), "structure"));
  auto alone = run();
  alone.uses.clear();
  testing::internal::CaptureStderr();
  structure.start(alone);
  const auto said = testing::internal::GetCapturedStderr();
  EXPECT_NE(said.find("case.toml:3:1: warning: structure.mesh: the mesh is 2002 m large. Lengths are metres: was it drawn in millimetres?"),
            std::string::npos)
      << said;
  EXPECT_EQ(structure.advance(window(0), {}).steps, 1u);
}

}  // namespace
}  // namespace acopla::fem::test
