// Two-way schemes on two masses and three springs, in one process: orders, agreement, energy, and what is said where they fail.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <Eigen/LU>
#include <filesystem>

#include "coupler/replay.h"
#include "coupler/stability.h"
#include "tests/integration/in_process.h"
#include "tests/integration/oscillator.h"
#include "tests/integration/stubs.h"

namespace acopla {
namespace {

using coupler::Outcome;
using coupler::Status;

std::string case_text(double window, double end, const std::string& coupling) {
  return fmt::format(R"(
title = "two masses"
dimension = 3
end = {}
[coupling]
window = {}
max_distance = 0.1
{}
[[coupling.interface]]
from = "first.spring"
to = "second.mass"
[first]
command = ["a"]
[second]
command = ["b"]
)", end, window, coupling);
}

Outcome run(const std::string& text, protocol::Participant& first, protocol::Participant& second) {
  static int runs = 0;
  in_process::Door door;
  return in_process::run(text, {{"first", &first}, {"second", &second}}, fmt::format("inproc://two-way-{}", ++runs), door);
}

struct Swing {
  oscillator::Loader first;
  oscillator::Structure second;
  Outcome outcome;
  // Root mean square over both masses and all windows [m].
  double error(double window) const {
    double square = 0;
    for (std::size_t k = 0; k < second.history.size(); ++k) {
      const double t = window * static_cast<double>(k + 1);
      square += std::pow(first.history[k] - oscillator::exact(1, t), 2) + std::pow(second.history[k] - oscillator::exact(2, t), 2);
    }
    return std::sqrt(square / 2 / static_cast<double>(second.history.size()));
  }
};

Swing swing(double window, double end, const std::string& coupling) {
  Swing swing;
  swing.outcome = run(case_text(window, end, coupling), swing.first, swing.second);
  EXPECT_EQ(swing.outcome.status, Status::met) << (swing.outcome.error ? swing.outcome.error->message : "");
  return swing;
}

double order(double end, const std::string& coupling, double window) {
  return std::log2(swing(window, end, coupling).error(window) / swing(window / 2, end, coupling).error(window / 2));
}

const char* const serial = "scheme = \"explicit\"";
const char* const parallel = "scheme = \"parallel\"\nallow_unstable_scheme = true";
const char* const implicit = "scheme = \"implicit\"\ntolerance = 1e-11";

TEST(TwoWay, TheStaggeredSchemeIsOfSecondOrder) { EXPECT_NEAR(order(1, serial, 1.0 / 128), 2, 0.1); }
TEST(TwoWay, TheParallelSchemeIsOfFirstOrder) { EXPECT_NEAR(order(1, parallel, 1.0 / 1024), 1, 0.1); }
TEST(TwoWay, TheImplicitSchemeIsOfSecondOrder) { EXPECT_NEAR(order(1, implicit, 1.0 / 64), 2, 0.1); }

// What the iterations converge to is the scheme's affair, and not the acceleration's.
TEST(TwoWay, AllAccelerationsReachTheSameSolution) {
  const double window = 1.0 / 32;
  const auto reference = swing(window, 1, std::string(implicit) + "\nacceleration = \"iqn-ils\"");
  for (const char* other : {"acceleration = \"aitken\"", "acceleration = \"constant\"\nrelaxation = 0.9\nmax_iterations = 200",
                            "acceleration = \"iqn-ils\"\nreuse = 8", "acceleration = \"iqn-ils\"\nrelaxation = 0.1"}) {
    const auto same = swing(window, 1, std::string(implicit) + "\n" + other);
    ASSERT_EQ(same.second.history.size(), reference.second.history.size());
    for (std::size_t k = 0; k < reference.second.history.size(); ++k) {
      // 32 windows, each within 1e-11 of its motion of some tenths of a metre.
      EXPECT_NEAR(same.second.history[k], reference.second.history[k], 1e-10) << other;
      EXPECT_NEAR(same.first.history[k], reference.first.history[k], 1e-10) << other;
    }
  }
}

// The monolithic solution: both masses in one system, mass 1 as finely as here, mass 2 by the trapezoidal rule over the window under the mean of the
// spring's force, solved for (u', v') of mass 2 by Newton with differences, which a linear system ends in one step.
TEST(TwoWay, ImplicitReachesTheMonolithicSolution) {
  const double h = 1.0 / 16;
  const auto coupled = swing(h, 1, implicit);
  oscillator::Loader first;
  oscillator::Structure second;
  const auto window_of = [&](int n) { return protocol::Window{n, n + 1, n * h, h}; };
  for (int n = 0; n < 16; ++n) {
    const auto answer = [&](const Eigen::Vector2d& end, bool keep) {
      auto a = first;
      auto b = second;
      const auto vector = [](double value) { return std::vector<geometry::Vec3>{geometry::Vec3(value, 0, 0)}; };
      const auto sent = a.advance(window_of(n), {{"spring", "displacement", vector(b.u)}, {"spring", "velocity", vector(b.v)},
                                                 {"spring", "end_displacement", vector(end[0])}, {"spring", "end_velocity", vector(end[1])}});
      b.advance(window_of(n), {{"mass", "force", sent.fields[0].values}});
      const Eigen::Vector2d next(b.u, b.v);
      if (keep) first = a, second = b;
      return Eigen::Vector2d(next - end);
    };
    const Eigen::Vector2d guess(second.u, second.v), residual = answer(guess, false);
    Eigen::Matrix2d slope;
    slope << answer(guess + Eigen::Vector2d(1, 0), false) - residual, answer(guess + Eigen::Vector2d(0, 1), false) - residual;
    answer(guess - slope.inverse() * residual, true);
    EXPECT_NEAR(second.u, coupled.second.history[static_cast<std::size_t>(n)], 1e-10);
    EXPECT_NEAR(first.u, coupled.first.history[static_cast<std::size_t>(n)], 1e-10);
  }
}

// A lagged force feeds the swing; the mean force of the same window does not (ten periods of the slow swing and thirty of the fast one, of 43 windows each).
TEST(TwoWay, TheStaggeredSchemeKeepsTheEnergyThatTheParallelOneMakes) {
  const double window = 1.0 / 128;
  const auto energy = [](const Swing& s) {
    using namespace oscillator;
    return 0.5 * mass * (s.first.v * s.first.v + s.second.v * s.second.v) +
           0.5 * wall_spring * (s.first.u * s.first.u + s.second.u * s.second.u) + 0.5 * middle_spring * std::pow(s.first.u - s.second.u, 2);
  };
  const double start = 0.5 * (oscillator::wall_spring + oscillator::middle_spring);
  EXPECT_NEAR(energy(swing(window, 10, serial)) / start, 1, 0.006);
  EXPECT_GT(energy(swing(window, 10, parallel)) / start, 2);
}

// Before the first contact nothing is exchanged but zeros, which no acceleration must stumble over.
TEST(TwoWay, AContactThatBeginsLateIsMetByEveryAcceleration) {
  for (const char* acceleration : {"iqn-ils", "aitken", "constant"}) {
    Swing s;
    s.first.only_pushes = true;
    s.first.gap = 0.5;
    s.first.wall = 0;
    s.first.u = 0;
    s.first.v = 1;  // [m/s]: it meets mass 2, at rest, after half a second
    s.second.wall = 0;
    s.outcome = run(case_text(1.0 / 64, 1.5, fmt::format("{}\nacceleration = \"{}\"", "scheme = \"implicit\"\ntolerance = 1e-9", acceleration)), s.first, s.second);
    ASSERT_EQ(s.outcome.status, Status::met) << acceleration << s.outcome.error->message;
    EXPECT_EQ(s.second.history[30], 0);
    // Equal masses exchange their velocities, to second order in the window; the impulse is the same on both sides whatever the iterations left.
    EXPECT_NEAR(s.first.v + s.second.v, 1, 4e-15) << acceleration;
    EXPECT_NEAR(s.second.v, 1, 1e-5) << acceleration;
  }
}

// With a dashpot the force jumps where the masses touch, and whether they do in this step or the next is for the iterations to find: where no motion agrees with
// its own force, both sides of the jump are found, within the tolerance of the motion.
TEST(TwoWay, AContactThatBeginsWithAJumpIsMetOnOneSideOfIt) {
  std::int64_t jumped = 0;
  for (int k = 0; k < 20; ++k) {
    Swing s;
    s.first.only_pushes = true;
    s.first.dashpot = 20;  // 20 N at first touch
    s.second.own_mass = 0.1;  // which the jump moves
    s.first.gap = 0.3 + 1e-3 * k;
    s.first.wall = s.first.u = s.second.wall = 0;
    s.first.v = 1;
    s.outcome = run(case_text(1.0 / 64, 0.75, "scheme = \"implicit\"\ntolerance = 1e-10\nmax_iterations = 80"), s.first, s.second);
    ASSERT_EQ(s.outcome.status, Status::met) << s.first.gap << s.outcome.error->message;
    EXPECT_NEAR(s.first.v + 0.1 * s.second.v, 1, 4e-15);
    EXPECT_EQ(s.outcome.ledgers.not_converged, 0);
    jumped += s.outcome.ledgers.jumped;
  }
  EXPECT_GT(jumped, 3);
}

// Against a fixed partner the staggered scheme is neutral, with dashpots it loses energy, until (k Δt² + 2 c Δt)/m = 4 (docs/theory.md): whatever the
// structure's own spring is, which its implicit step takes.
TEST(TwoWay, TheStaggeredSchemeIsStableUpToItsLimitAndNotBeyond) {
  const double window = 0.01;
  // How much farther it goes in the second half of a run than in the first.
  const auto growth = [&](double limit_share, double damped_part, double own_spring, std::size_t windows) {
    Swing s;
    const double x = 4 * limit_share;  // (k Δt² + 2 c Δt)/m
    s.first.own_mass = 1e15;
    s.first.wall = s.first.u = 0;
    s.first.stiffness = (1 - damped_part) * x / (window * window);
    s.first.dashpot = damped_part * x / (2 * window);
    s.second.wall = own_spring;
    s.second.u = 0.01;
    s.second.v = 0.3;
    s.outcome = run(case_text(window, window * static_cast<double>(windows), std::string(serial) + "\nallow_unstable_scheme = true"), s.first, s.second);
    EXPECT_FALSE(s.outcome.error) << s.outcome.error->message;
    const auto farthest = [&](std::size_t from, std::size_t to) {
      double far = 0;
      for (auto k = from; k < to; ++k) far = std::max({far, std::abs(s.second.history[k]), window * std::abs(s.second.velocities[k])});
      return far;
    };
    return farthest(windows / 2, windows) / farthest(0, windows / 2);
  };
  for (const double damped_part : {0.0, 0.3, 0.9})
    for (const double own_spring : {0.0, 1e3, 1e7}) {
      EXPECT_LT(growth(0.9, damped_part, own_spring, 1000), 1.01) << damped_part << " " << own_spring;
      // Beside a stiff spring of its own the growth beyond the limit is slow: 4 (share − 1)/(1 + K Δt²/4m) a window.
      if (own_spring < 1e6) {
        EXPECT_GT(growth(1.1, damped_part, own_spring, 100), 1e3) << damped_part << " " << own_spring;
      }
    }
}

TEST(TwoWay, WhereBothSidesSaySoTheLimitIsWatched) {
  const auto judged = [](double share, const std::string& more = "") {
    Swing s;
    s.first.stiffness = std::pow(share / 0.01, 2);  // ω_c Δt = share
    s.second.knows_its_mass = true;
    s.outcome = run(case_text(0.01, 0.1, std::string(serial) + more), s.first, s.second);
    return s.outcome.error ? s.outcome.error->message : "";
  };
  EXPECT_EQ(judged(0.99), "");
  EXPECT_NE(judged(1.01).find("1.01 radians a window"), std::string::npos) << judged(1.01);
  EXPECT_EQ(judged(1.01, "\nallow_unstable_scheme = true"), "");
}

// What a sudden force moves may cost a structure a while to work out, and only explicit schemes read it.
TEST(TwoWay, ExplicitSchemesAloneAskForMasses) {
  for (const auto& [coupling, asks] : {std::pair{serial, true}, {parallel, true}, {implicit, false}}) {
    Swing s;
    s.outcome = run(case_text(0.01, 0.02, coupling), s.first, s.second);
    EXPECT_FALSE(s.outcome.error) << s.outcome.error->message;
    EXPECT_EQ(s.second.was_asked, asks) << coupling;
  }
}

// What the coupler says of a particle and a node is what becomes of them in a run.
TEST(TwoWay, AParticleOnANodeGrowsAsEstimated) {
  const double window = 0.01;
  struct Pair {
    double turn, ratio, particle;
    bool held;
  };
  for (const auto& [turn, ratio, particle, held] : {Pair{0.1, 0, 1e-3, false}, {0.5, 0, 0.1, false}, {1.5, 0, 1, false}, {0.5, 0.02, 1, false},
                                                    {0.5, 0, 0.1, true}, {1, 0, 1e-3, true}, {0.5, 0.02, 0.1, true}, {2.9, 0.33, 1e-3, true}, {2.7, 0.33, 1e-3, true}}) {
    Swing s;
    s.first.own_mass = particle;
    s.second.wall = 0;
    s.first.steps = 256;
    s.first.stiffness = std::pow(turn / window, 2);
    s.first.dashpot = 2 * ratio * std::sqrt(s.first.stiffness * particle / (1 + particle));
    s.first.wall = held ? s.first.stiffness : 0;
    s.first.wall_dashpot = held ? s.first.dashpot : 0;
    s.first.u = 0.01, s.second.u = held ? 0.01 : 0;
    const coupler::Touch touch{s.first.stiffness, s.first.dashpot, particle, 1};
    const double expected = std::log1p(held ? coupler::growth_of_held_particle(touch, window) : coupler::growth_of_free_particle(touch, window));
    // So many windows that it trebles, or falls to a third, and no fewer than some swings.
    const auto windows = static_cast<std::size_t>(std::clamp(2 / std::abs(expected), std::abs(expected) > 0.1 ? 30.0 : 300.0, 6000.0));
    s.outcome = run(case_text(window, window * static_cast<double>(3 * windows), std::string(serial) + "\nallow_unstable_scheme = true"), s.first, s.second);
    ASSERT_FALSE(s.outcome.error) << s.outcome.error->message;
    // Of the free one their distance, since the pair goes its way.
    const auto size = [&](std::size_t from) {
      double square = 0;
      for (auto k = from; k < from + windows; ++k) square += std::pow(held ? s.second.history[k] : s.first.history[k] - s.second.history[k], 2);
      return std::sqrt(square);
    };
    const double grown = std::log(size(2 * windows) / size(windows)) / static_cast<double>(windows);
    EXPECT_NEAR(grown, expected, 0.05 * std::abs(expected) + 2e-5) << turn << " " << ratio << " " << particle << " " << held;
  }
}

// Two springs side by side on one surface.
class TwoLoaders final : public protocol::Participant {
 public:
  oscillator::Loader left, right;
  protocol::Introduction introduce() const override { return left.introduce(); }
  std::vector<protocol::Surface> start(const protocol::Run& run) override {
    auto surfaces = left.start(run);
    surfaces[0].mesh.points.push_back(surfaces[0].mesh.points[0] + geometry::Vec3(10, 0, 0));
    return surfaces;
  }
  protocol::Advance advance(const protocol::Window& window, const std::vector<protocol::Field>& received) override {
    const auto part = [&](std::size_t point) {
      auto fields = received;
      for (auto& field : fields) field.values = {field.values[point]};
      return fields;
    };
    auto both = left.advance(window, part(0));
    both.fields[0].values.push_back(right.advance(window, part(1)).fields[0].values[0]);
    return both;
  }
  void save() override { left.save(), right.save(); }
  void restore() override { left.restore(), right.restore(); }
};

class FarStructure final : public oscillator::Structure {
 public:
  std::vector<protocol::Surface> start(const protocol::Run& run) override {
    auto surfaces = oscillator::Structure::start(run);
    for (auto& point : surfaces[0].mesh.points) point.x() += 10;
    return surfaces;
  }
};

TEST(TwoWay, OneSurfaceMovesWithSeveralStructuresEachPointWithItsOwn) {
  for (const auto* const scheme : {serial, implicit}) {
    TwoLoaders loaders;
    loaders.right.u = 0.5;
    oscillator::Structure second;
    FarStructure third;
    third.v = 1;
    auto text = case_text(1.0 / 64, 1, scheme);
    text.replace(text.find("to = \"second.mass\""), 18, "to = [\"second.mass\", \"third.mass\"]");
    text += "[third]\ncommand = [\"c\"]\n";
    in_process::Door door;
    const auto outcome = in_process::run(text, {{"first", &loaders}, {"second", &second}, {"third", &third}}, fmt::format("inproc://shared-{}", scheme == serial), door);
    ASSERT_FALSE(outcome.error) << outcome.error->message;
    EXPECT_LE(outcome.ledgers.force_loss, 1e-15);
    EXPECT_EQ(outcome.interfaces.size(), 2u);
    // Alone, each goes as it went here: to the tolerance, as together they iterate until both agree.
    const double close = scheme == serial ? 1e-15 : 1e-9;
    Swing near, far;
    far.first.u = 0.5, far.second.v = 1;
    for (auto* each : {&near, &far}) each->outcome = run(case_text(1.0 / 64, 1, scheme), each->first, each->second);
    for (std::size_t k = 0; k < 64; ++k) {
      ASSERT_NEAR(second.history[k], near.second.history[k], close);
      ASSERT_NEAR(third.history[k], far.second.history[k], close);
      ASSERT_NEAR(loaders.right.history[k], far.first.history[k], close);
    }
  }
}

TEST(TwoWay, WindowsCanBeSoManySteps) {
  Swing s;
  s.first.step = 0.001;
  auto text = case_text(1, 0.1, serial);
  text.replace(text.find("window = 1"), 10, "window = \"steps:3\"");
  s.outcome = run(text, s.first, s.second);
  ASSERT_FALSE(s.outcome.error) << s.outcome.error->message;
  EXPECT_EQ(s.outcome.windows, 34);  // of 2.94 ms
  EXPECT_EQ(s.first.steps, 3);
  EXPECT_EQ(s.outcome.reached, 0.1);
  // Nobody says how long its steps are.
  Swing silent;
  const auto outcome = run(text, silent.first, silent.second);
  ASSERT_TRUE(outcome.error);
  EXPECT_NE(outcome.error->message.find("no participant here says how long its steps are"), std::string::npos) << outcome.error->message;
}

std::string automatic(double end) {
  auto text = case_text(1, end, serial);
  text.replace(text.find("window = 1"), 10, "window = \"auto\"");
  return text;
}

TEST(TwoWay, AutomaticWindowsAreTheLongestThatAreStable) {
  const auto longest = [](double stiffness) {
    Swing s;
    s.first.step = 1e-4;
    s.first.stiffness = stiffness;
    s.second.knows_its_mass = true;
    s.outcome = run(automatic(1), s.first, s.second);
    EXPECT_FALSE(s.outcome.error) << s.outcome.error->message;
    return s.first.steps;
  };
  // ω_c Δt ≤ 0.5 with M = 1 kg: 50, and 5 steps of 1e-4 s, so that 32, and 4, of at most that are the longest.
  EXPECT_EQ(longest(1e4), 32);
  EXPECT_EQ(longest(1e6), 4);
}

TEST(TwoWay, AutomaticWindowsTakeBackWhatAFirstContactShowsToBeTooLong) {
  // A mass of 1 kg hits another at rest, which nothing holds: they exchange their speeds, in ten steps. The windows are long by then.
  const auto hit = [](const std::string& text) {
    Swing s;
    s.first.only_pushes = true;
    s.first.step = 1e-4;
    s.first.u = -0.1, s.first.v = 1;
    s.first.wall = s.second.wall = 0;
    s.first.stiffness = 5e6;  // half a swing of both is 1 ms long
    s.second.knows_its_mass = true;
    s.outcome = run(text, s.first, s.second);
    EXPECT_FALSE(s.outcome.error) << s.outcome.error->message;
    return std::pair{s.second.v, s.outcome};
  };
  const auto [speed, outcome] = hit(automatic(0.2048));
  EXPECT_NEAR(speed, 1, 0.02);
  EXPECT_LT(outcome.windows, 400);                         // of 2048 steps
  // As long as it liked to be, the same window makes as much energy as there was.
  auto fixed = case_text(0.0064, 0.2048, std::string(serial) + "\nallow_unstable_scheme = true");
  EXPECT_GT(hit(fixed).first, 1.5);
}

TEST(TwoWay, TheEnergyThatTheCouplingMadeIsBookedAndLimited) {
  const auto explicitly = swing(1.0 / 64, 1, serial), implicitly = swing(1.0 / 64, 1, implicit);
  EXPECT_GT(std::abs(explicitly.outcome.ledgers.energy_made), 1e-3);
  EXPECT_LT(std::abs(implicitly.outcome.ledgers.energy_made), 1e-8);
  oscillator::Loader first;
  oscillator::Structure second;
  const auto stopped = run(case_text(1.0 / 64, 1, std::string(serial) + "\nlimits = { energy_made = 1e-6 }"), first, second);
  ASSERT_TRUE(stopped.error);
  EXPECT_NE(stopped.error->message.find("coupling.limits.energy_made"), std::string::npos) << stopped.error->message;
  EXPECT_EQ(stopped.exit_code, 3);
}

TEST(TwoWay, AWindowThatDoesNotConvergeSaysHow) {
  const auto message = [](const std::string& coupling, double second_mass = 1) {
    oscillator::Loader first;
    oscillator::Structure second;
    second.own_mass = second_mass;
    const auto outcome = run(case_text(1.0 / 16, 1, coupling), first, second);
    return outcome.error ? outcome.error->message : "";
  };
  EXPECT_NE(message("scheme = \"implicit\"\nacceleration = \"constant\"\nrelaxation = 0.01\nmax_iterations = 5").find("creeps"), std::string::npos);
  // A light mass behind a stiff spring: the answer overshoots, and more the second time; a third would be taken from between them.
  const auto grows = message("scheme = \"implicit\"\nacceleration = \"constant\"\nrelaxation = 1\nmax_iterations = 2", 0.01);
  EXPECT_NE(grows.find("grows"), std::string::npos) << grows;
  Swing accepted;
  accepted.outcome = run(case_text(1.0 / 16, 1, "scheme = \"implicit\"\nacceleration = \"constant\"\nrelaxation = 0.01\nmax_iterations = 5\non_fail = \"accept\""),
                         accepted.first, accepted.second);
  EXPECT_EQ(accepted.outcome.status, Status::met);
  EXPECT_EQ(accepted.outcome.ledgers.not_converged, 16);
}

// A structure whose motion was recorded plays it again: whoever met it meets the same, bit for bit, in every scheme.
TEST(TwoWay, ARecordedStructureAnswersAsItDid) {
  const auto folder = std::filesystem::temp_directory_path() / fmt::format("acopla-replay-{}", getpid());
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  const std::string endpoint = "inproc://replayed";
  oscillator::Loader first, again;
  oscillator::Structure second;
  second.u = 0.1;
  const auto text = case_text(1.0 / 32, 1, "scheme = \"explicit\"\nrecord_motion = true");
  in_process::Door door;
  ASSERT_EQ(in_process::run(text, {{"first", &first}, {"second", &second}}, endpoint, door, folder.string()).status, Status::met);
  for (const char* scheme : {"explicit", "parallel\"\nallow_unstable_scheme = true\n#\"", "implicit"}) {
    auto played = case_text(1.0 / 32, 1, fmt::format("scheme = \"{}\"", scheme));
    played.replace(played.find("command = [\"b\"]"), 15, fmt::format("replay = \"{}\"", folder.string()));
    again = {};
    in_process::Door other;
    const auto outcome = in_process::run(played, {{"first", &again}}, fmt::format("{}-{}", endpoint, played.size()), other);
    ASSERT_EQ(outcome.status, Status::met) << (outcome.error ? outcome.error->message : "");
    ASSERT_EQ(again.history.size(), first.history.size());
    if (std::string(scheme) == "implicit") {  // follows the recorded motion on a cubic instead of a straight line
      for (std::size_t k = 0; k < first.history.size(); ++k) EXPECT_NEAR(again.history[k], first.history[k], 0.1);
    } else {
      EXPECT_EQ(again.history, first.history);
    }
  }
  // In windows half as long the structure is between two recorded instants.
  auto finer = case_text(1.0 / 64, 1, "scheme = \"explicit\"");
  finer.replace(finer.find("command = [\"b\"]"), 15, fmt::format("replay = \"{}\"", folder.string()));
  again = {};
  in_process::Door other;
  ASSERT_EQ(in_process::run(finer, {{"first", &again}}, endpoint + "-finer", other).status, Status::met);
  EXPECT_NEAR(again.history.back(), first.history.back(), 0.1);
  std::filesystem::remove_all(folder);
}

TEST(TwoWay, ARecordWithoutMotionCannotAnswer) {
  const auto folder = std::filesystem::temp_directory_path() / fmt::format("acopla-forces-{}", getpid());
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  oscillator::Loader first;
  oscillator::Structure second;
  in_process::Door door;
  ASSERT_EQ(in_process::run(case_text(0.1, 0.2, serial), {{"first", &first}, {"second", &second}}, "inproc://forces", door, folder.string()).status, Status::met);
  protocol::Run asked;
  asked.uses = {{"mass", {"force"}, {"displacement", "velocity"}}};
  try {
    coupler::Replay({folder.string(), "second", {}, {}, 0}, "second").start(asked);
    FAIL() << "no error";
  } catch (const io::UserError& error) {
    EXPECT_NE(std::string(error.what()).find("the record holds no motion of second.mass. Run the case that makes it with coupling.record_motion = true."),
              std::string::npos)
        << error.what();
  }
  std::filesystem::remove_all(folder);
}

TEST(TwoWay, WhatTheCaseAsksWronglyIsSaid) {
  const auto refusal = [](const std::string& coupling) -> std::string {
    try {
      coupler::read_case(io::Table::from_text(case_text(0.1, 1, coupling), "case.toml"));
    } catch (const io::UserError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_NE(refusal("scheme = \"parallel\"").find("allow_unstable_scheme"), std::string::npos);
  EXPECT_NE(refusal("scheme = \"explicit\"\nmax_iterations = 3").find("\"implicit\" only"), std::string::npos);
  EXPECT_NE(refusal("scheme = \"implicit\"\nrelaxation = 0").find("relaxation"), std::string::npos);
  EXPECT_NE(refusal("scheme = \"explicit\"\nloads = \"mean\"").find("\"one-way\" only"), std::string::npos);
  EXPECT_NE(refusal("scheme = \"implicit\"\ntolerance = { relative = 0 }").find("both displacement"), std::string::npos);
}

TEST(TwoWay, WhoCannotReturnIsRefusedForImplicitAtOnce) {
  class Forward final : public protocol::Participant {
   public:
    oscillator::Structure inner;
    protocol::Introduction introduce() const override { return {"forward", 3, {}}; }
    std::vector<protocol::Surface> start(const protocol::Run& run) override { return inner.start(run); }
    protocol::Advance advance(const protocol::Window& window, const std::vector<protocol::Field>& fields) override { return inner.advance(window, fields); }
  } second;
  oscillator::Loader first;
  const auto outcome = run(case_text(0.1, 1, implicit), first, second);
  ASSERT_TRUE(outcome.error);
  EXPECT_EQ(outcome.error->participant, "second");
  EXPECT_NE(outcome.error->message.find("cannot return to the start of a window"), std::string::npos) << outcome.error->message;
}

// A plate of many points that answers in a way which no two points share.
class Plate final : public protocol::Participant {
 public:
  Plate(std::string surface, std::vector<std::string> sends) : surface_(std::move(surface)), sends_(std::move(sends)) {}
  protocol::Introduction introduce() const override { return {"plate", 3, {}, 0}; }
  std::vector<protocol::Surface> start(const protocol::Run&) override { return {{surface_, mesh_, {}, {}, {}}}; }
  protocol::Advance advance(const protocol::Window& window, const std::vector<protocol::Field>& received) override {
    protocol::Advance advance;
    for (const auto& field : received) heard.insert(heard.end(), field.values.begin(), field.values.end());
    for (const auto& name : sends_) {
      std::vector<Eigen::Vector3d> values;
      for (std::size_t p = 0; p < mesh_.points.size(); ++p) values.push_back(1e-3 * stubs::known_force(window.start, p) + 0.1 * received[0].values[p]);
      advance.fields.push_back({surface_, name, std::move(values)});
    }
    return advance;
  }
  std::vector<Eigen::Vector3d> heard;

 private:
  std::string surface_;
  std::vector<std::string> sends_;
  geometry::SurfaceMesh mesh_ = stubs::square(24, false);
};

// 625 points are 15 KB a field: over ipc they go through shared memory, in one process as they are.
TEST(TwoWay, LongFieldsThroughSharedMemoryArriveBitForBit) {
  const auto heard = [](const std::string& endpoint) {
    Plate first("spring", {"force"}), second("mass", {"displacement", "velocity"});
    in_process::Door door;
    const auto outcome = in_process::run(case_text(0.5, 10, serial), {{"first", &first}, {"second", &second}}, endpoint, door);
    EXPECT_EQ(outcome.status, Status::met) << (outcome.error ? outcome.error->message : "");
    first.heard.insert(first.heard.end(), second.heard.begin(), second.heard.end());
    return first.heard;
  };
  const auto apart = heard(fmt::format("ipc:///tmp/acopla-two-way-{}", getpid())), together = heard("inproc://two-way-plates");
  ASSERT_EQ(apart.size(), 20u * 3 * 625);
  EXPECT_TRUE(apart == together);
}

}  // namespace
}  // namespace acopla
