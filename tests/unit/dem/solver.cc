// The particles as a participant: walls moved by somebody else, particles that come and go, rolling back, settling, starting from a
// checkpoint.
#include "dem/solver.h"

#include <gtest/gtest.h>

#include <unistd.h>

#include <filesystem>

namespace acopla::dem::test {
namespace {

const std::string head = R"(dimension = 2
end = 1.0
gravity = [0, -9.81]
[g]
solver = "dem"
[g.material.sand]
density = 1000
[[g.contact]]
between = [["sand", "sand"]]
normal = { law = "linear", stiffness = 1e5 }
tangential = "linear_slider"
rolling = "elastic_plastic"
restitution = 0.5
friction = 0.5
rolling_friction = 0.1
)";

std::unique_ptr<Solver> solver_of(const std::string& text, const std::string& file = "case.toml") {
  return std::make_unique<Solver>(io::Table::from_text(text, file), "g");
}

protocol::Run run_of(const Vec3& gravity, std::vector<protocol::Run::Use> uses = {}, const std::string& results = "") {
  protocol::Run run;
  run.tick = 1e-3;
  run.end = 1000;
  run.window = 10;
  for (int d = 0; d < 3; ++d) run.gravity[d] = gravity[d];
  run.results = results;
  run.uses = std::move(uses);
  return run;
}

protocol::Window window(std::int64_t k) { return {10 * k, 10 * (k + 1), 0.01 * static_cast<double>(k), 0.01}; }

double value(const std::vector<std::pair<std::string, double>>& values, const std::string& name) {
  for (const auto& [key, number] : values)
    if (key == name) return number;
  ADD_FAILURE() << "no quantity " << name;
  return 0;
}

TEST(CoupledWall, SaysWhereItsOwnMotionHasBroughtIt) {
  auto text = head + R"([g.wall.blade]
line = [[0, 0], [1, 0], [1, 0.5]]
material = "sand"
motion = { kind = "rotation", rpm = 30, centre = [0.25, 0.1] }
[[g.insert]]
material = "sand"
particles = [{ at = [5, 5], diameter = 0.1 }]
)";
  const auto solver = solver_of(text);
  const auto surfaces = solver->start(run_of(Vec3(0, -9.81, 0), {{"blade", {}, {"force", "displacement"}}}));
  ASSERT_EQ(surfaces.size(), 1u);
  for (const auto& u : surfaces[0].displacement) EXPECT_EQ(u, Vec3(0, 0, 0)) << "it begins where the case puts it";
  const Vec3 centre(0.25, 0.1, 0);
  for (int k = 0; k < 30; ++k) {
    const auto fields = solver->advance(window(k), {}).fields;
    ASSERT_EQ(fields.size(), 2u);
    EXPECT_EQ(fields[1].name, "displacement");
    const Eigen::AngleAxisd turn(M_PI * 0.01 * (k + 1), Vec3::UnitZ());
    for (std::size_t v = 0; v < surfaces[0].mesh.points.size(); ++v) {
      const Vec3 expected = centre + turn * (surfaces[0].mesh.points[v] - centre) - surfaces[0].mesh.points[v];
      EXPECT_LT((fields[1].values[v] - expected).norm(), 1e-12) << "window " << k << ", vertex " << v;
    }
  }
}

TEST(CoupledWall, ElasticBallBouncesOffAMovingSegmentAtTwiceItsSpeed) {
  // In the wall's frame the ball only turns round: v' = 2 V. The wall moves as a coupled solver says, window by window.
  auto text = head;
  text.replace(text.find("restitution = 0.5"), 17, "restitution = 1.0");
  text += R"([g.wall.piston]
line = [[-1, 0], [1, 0]]
material = "sand"
[[g.insert]]
material = "sand"
particles = [{ at = [0.1, 0.08], diameter = 0.1 }]
)";
  const auto solver = solver_of(text);
  const auto surfaces = solver->start(run_of(Vec3::Zero(), {{"piston", {"displacement", "velocity"}, {"force"}}}));
  ASSERT_EQ(surfaces.size(), 1u);
  ASSERT_EQ(surfaces[0].mesh.points.size(), 2u);
  const Vec3 speed(0, 0.5, 0);
  Vec3 impulse = Vec3::Zero();
  double kinetic = 0;
  for (int k = 0; k < 30; ++k) {
    const Vec3 at = 0.01 * k * speed;
    const auto result = solver->advance(window(k), {{"piston", "displacement", {at, at}}, {"piston", "velocity", {speed, speed}}});
    ASSERT_EQ(result.fields.size(), 1u);
    for (const auto& force : result.fields[0].values) impulse += 0.01 * force;
    kinetic = value(result.quantities, "kinetic_energy");
  }
  const double mass = 1000 * M_PI * 0.05 * 0.05;
  // The contact lasts some 28 steps: second order of the step leaves 1e-4 of the speed.
  EXPECT_NEAR(kinetic, 0.5 * mass * 1.0, 2e-3 * mass);
  // What the wall received is what the ball was given, to round-off.
  EXPECT_NEAR(-impulse[1], std::sqrt(2 * kinetic * mass), 1e-12);
}

TEST(CoupledWall, AWallWithAMotionOfItsOwnIsRefused) {
  const auto solver = solver_of(head + R"([g.wall.piston]
line = [[-1, 0], [1, 0]]
material = "sand"
motion = { kind = "translation", velocity = [0, 1] }
[[g.insert]]
material = "sand"
particles = [{ at = [0.1, 0.08], diameter = 0.1 }]
)");
  EXPECT_THROW(solver->start(run_of(Vec3::Zero(), {{"piston", {"displacement"}, {}}})), io::UserError);
}

const std::string flow = R"([[g.inlet]]
material = "sand"
diameter = 0.02
rate = 20
region = { box = [[0, 0.6], [0.4, 0.8]] }
velocity = [0, -1]
[[g.outlet]]
name = "drain"
region = { box = [[-1, -0.5], [2, -0.1]] }
)";

TEST(Traffic, MassComesAtItsRateAndIsThereOrHasLeft) {
  auto text = head;
  text.insert(text.find("[g.material"), "threads = 2\nenergy = true\ndrift_limit = 1.0\n");
  const auto solver = solver_of(text + flow);
  solver->start(run_of(Vec3(0, -9.81, 0)));
  const double particle = 1000 * M_PI * 0.01 * 0.01;
  for (int k = 0; k < 100; ++k) {
    const auto values = solver->advance(window(k), {}).quantities;
    // Visited at least every hundred steps: the rate is followed to one particle and what is due until the next visit.
    ASSERT_NEAR(value(values, "inlet0.mass"), 20 * 0.01 * (k + 1), 2.5 * particle) << k;
    ASSERT_NEAR(value(values, "weight") / 9.81 + value(values, "drain.mass"), value(values, "inlet0.mass"), 1e-9);
    if (k == 99) {
      EXPECT_GT(value(values, "drain.count"), 20);
      EXPECT_GT(value(values, "particles"), 10);
    }
  }
}

TEST(RollBack, RestoreUndoesAWindowInletsIncluded) {
  const auto once = solver_of(head + flow), twice = solver_of(head + flow);
  once->start(run_of(Vec3(0, -9.81, 0)));
  twice->start(run_of(Vec3(0, -9.81, 0)));
  for (int k = 0; k < 60; ++k) {
    const auto a = once->advance(window(k), {}).quantities;
    twice->save();
    twice->advance(window(k), {});
    twice->restore();
    const auto b = twice->advance(window(k), {}).quantities;
    ASSERT_EQ(a, b) << k;
  }
}

const std::string heap = R"([g.wall.floor]
plane = { point = [0, 0], normal = [0, 1] }
material = "sand"
[g.wall.left]
plane = { point = [0, 0], normal = [1, 0] }
material = "sand"
[g.wall.right]
plane = { point = [0.3, 0], normal = [-1, 0] }
material = "sand"
[[g.insert]]
material = "sand"
diameter = 0.02
count = 60
region = { box = [[0, 0], [0.3, 0.4]] }
)";

TEST(Settling, TimeBeginsWithParticlesAtRest) {
  auto text = head;
  text.insert(text.find("[g.material"), "settle = { kinetic_energy = 1e-5, limit = 20 }\n");
  const auto solver = solver_of(text + heap);
  solver->start(run_of(Vec3(0, -9.81, 0)));
  const auto values = solver->advance(window(0), {}).quantities;
  EXPECT_LT(value(values, "kinetic_energy"), 2e-5 * value(values, "weight") * 0.01);
  EXPECT_NEAR(value(values, "floor.force.y"), -value(values, "weight"), 0.02 * value(values, "weight"));
}

TEST(Settling, OneThatDoesNotEndSaysSo) {
  auto text = head;
  text.insert(text.find("[g.material"), "settle = { kinetic_energy = 1e-12, limit = 0.05 }\n");
  const auto solver = solver_of(text + heap);
  try {
    solver->start(run_of(Vec3(0, -9.81, 0)));
    FAIL() << "nothing was said";
  } catch (const io::UserError& error) {
    EXPECT_NE(std::string(error.what()).find("have not settled in 0.05 s"), std::string::npos) << error.what();
  }
}

class FromCheckpoint : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() / ("acopla_start_from_" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder_);
    auto text = head;
    text.insert(text.find("[g.material"), "output = { checkpoint = true, particles = false }\n");
    const auto first = solver_of(text + heap);
    auto run = run_of(Vec3(0, -9.81, 0), {}, folder_.string());
    run.end = 200;
    first->start(run);
    for (int k = 0; k < 20; ++k) first->advance(window(k), {});
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::string from(const std::string& take) const {
    auto text = head;
    text.insert(text.find("[g.material"), "start_from = { results = \"" + folder_.string() + "\", take = \"" + take + "\" }\n");
    return text;
  }
  static std::string floor() { return heap.substr(0, heap.find("[[g.insert]]")); }
  std::filesystem::path folder_;
};

TEST_F(FromCheckpoint, AWholeStateGoesOnBitByBit) {
  const auto whole = solver_of(head + heap);
  whole->start(run_of(Vec3(0, -9.81, 0)));
  for (int k = 0; k < 20; ++k) whole->advance(window(k), {});
  const auto continued = solver_of(from("state") + floor());
  continued->start(run_of(Vec3(0, -9.81, 0)));
  const auto without_bound = [](std::vector<std::pair<std::string, double>> values) {  // which is looked at now and then, from the start on
    std::erase_if(values, [](const auto& value) { return value.first == "step_ratio"; });
    return values;
  };
  for (int k = 0; k < 30; ++k)
    ASSERT_EQ(without_bound(whole->advance(window(20 + k), {}).quantities), without_bound(continued->advance(window(20 + k), {}).quantities)) << k;
}

TEST_F(FromCheckpoint, ParticlesMayGoToAnotherScene) {
  const auto other = solver_of(from("particles") + R"([g.wall.slope]
plane = { point = [0, 0], normal = [1, 3] }
material = "sand"
)");
  other->start(run_of(Vec3(0, -9.81, 0)));
  EXPECT_EQ(value(other->advance(window(0), {}).quantities, "particles"), 60);
}

TEST_F(FromCheckpoint, AStateOfAnotherSceneIsRefused) {
  const auto other = solver_of(from("state") + R"([g.wall.slope]
plane = { point = [0, 0], normal = [1, 3] }
material = "sand"
)");
  try {
    other->start(run_of(Vec3(0, -9.81, 0)));
    FAIL() << "nothing was said";
  } catch (const io::UserError& error) {
    EXPECT_NE(std::string(error.what()).find("is the state of another scene"), std::string::npos) << error.what();
    EXPECT_EQ(std::string(error.what()).find("case.toml:"), 0u) << error.what();
  }
}

TEST(StepBound, AStepBeyondItIsRefusedWithPlaceAndTime) {
  // A ball squeezed to half its radius between two planes: Hertz's contact is so stiff there that the Rayleigh time is 1.6 times the limit.
  const auto solver = solver_of(R"(dimension = 3
end = 1.0
[g]
solver = "dem"
step_fraction = 1.0
[g.material.rubber]
density = 1000
young = 1e6
poisson = 0.3
[[g.contact]]
between = [["rubber", "rubber"]]
normal = "hertz"
restitution = 1.0
[g.wall.floor]
plane = { point = [0, 0, 0], normal = [0, 0, 1] }
material = "rubber"
[g.wall.lid]
plane = { point = [0, 0, 0.01], normal = [0, 0, -1] }
material = "rubber"
[[g.insert]]
material = "rubber"
particles = [{ at = [0, 0, 0.005], diameter = 0.02 }]
)");
  solver->start(run_of(Vec3::Zero()));
  try {
    for (int k = 0; k < 4; ++k) solver->advance({0, 170, 0, 170 * 1.7e-3}, {});  // steps of 1.7 ms
    FAIL() << "nothing was said";
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("of the limit of the contacts there are now, of which those of particle 0 at (0, 0, 0.005) m"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace acopla::dem::test
