// Surfaces that move by themselves along what stands, while they send forces.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <Eigen/Geometry>
#include <filesystem>
#include <functional>

#include "coupler/replay.h"
#include "io/series.h"
#include "tests/integration/in_process.h"
#include "tests/integration/stubs.h"

namespace acopla {
namespace {

using coupler::Outcome;
using coupler::Status;
using geometry::Vec3;
namespace fs = std::filesystem;
using Points = std::vector<Vec3>;

constexpr int windows = 20;

std::string case_text(bool slides, const std::string& rest = "[grains]\ncommand = [\"a\"]\n", const std::string& coupling = "") {
  return fmt::format(R"(
dimension = 3
end = 2.0
[coupling]
scheme = "one-way"
window = 0.1
max_distance = 0.05
{}
[[coupling.interface]]
from = "grains.blade"
to = "structure.inside"
{}
[structure]
command = ["b"]
{})", coupling, slides ? "slides = true" : "", rest);
}

/// A plate of triangles that goes where it is told, with the forces of each window.
class Blade : public protocol::Participant {
 public:
  using Where = std::function<Vec3(double time, const Vec3& point)>;
  using Force = std::function<Vec3(double time, const Vec3& point)>;  // of the middle of a window
  Blade(geometry::SurfaceMesh mesh, Where where, Force force) : mesh_(std::move(mesh)), where_(std::move(where)), force_(std::move(force)) {}
  int dies_in = -1;
  bool tells = true;  // how it moves

  protocol::Introduction introduce() const override { return {"blade", 3, {"checkpoint"}}; }
  std::vector<protocol::Surface> start(const protocol::Run& run) override {
    for (const auto& use : run.uses) sends_ = use.sends;
    return {{"blade", mesh_, tells ? displacement(0) : Points(), {}, {}}};
  }
  protocol::Advance advance(const protocol::Window& window, const std::vector<protocol::Field>&) override {
    if (window.start == dies_in) throw std::runtime_error("the power failed");
    protocol::Advance advance;
    advance.steps = 1;
    Points force;
    for (const auto& point : mesh_.points) force.push_back(force_(window.start_time + 0.5 * window.length, point));
    advance.fields.push_back({"blade", "force", std::move(force)});
    if (tells && std::find(sends_.begin(), sends_.end(), "displacement") != sends_.end())
      advance.fields.push_back({"blade", "displacement", displacement(window.end_time())});
    return advance;
  }
  void checkpoint(const std::string&) override {}
  void resume(const std::string&) override {}
  const std::vector<std::string>& sends() const { return sends_; }

 private:
  Points displacement(double time) const {
    Points moved;
    for (const auto& point : mesh_.points) moved.push_back(where_(time, point) - point);
    return moved;
  }
  geometry::SurfaceMesh mesh_;
  Where where_;
  Force force_;
  std::vector<std::string> sends_;
};

class Receiver : public stubs::Receiver {
 public:
  protocol::Introduction introduce() const override { return {"stub", 3, {"checkpoint"}}; }
  void checkpoint(const std::string&) override {}
  void resume(const std::string&) override {}
};

class Travels : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / fmt::format("acopla-travel-{}", getpid());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  Outcome run(const std::string& text, Blade& blade, Receiver& receiver, const std::string& results = {}, bool resumes = false) {
    static int runs = 0;
    in_process::Door door;
    std::vector<in_process::Named> participants{{"structure", &receiver}};
    if (text.find("replay") == std::string::npos) participants.push_back({"grains", &blade});
    return in_process::run(text, participants, fmt::format("inproc://travel-{}", ++runs), door, results.empty() ? "" : (folder_ / results).string(), resumes);
  }
  void expect_met(const Outcome& outcome) { ASSERT_EQ(outcome.status, Status::met) << (outcome.error ? outcome.error->message : ""); }
  void expect_ended(const Outcome& outcome, const std::string& words) {
    ASSERT_TRUE(outcome.error) << "expected: " << words;
    EXPECT_NE(outcome.error->message.find(words), std::string::npos) << outcome.error->message;
  }
  fs::path folder_;
};

// A slider of a fifth of the receiver's side, under pressure while it lies on it.
geometry::SurfaceMesh slider() {
  auto mesh = stubs::square(3, true, 0.01);
  for (auto& point : mesh.points) point = Vec3(0.2 * point[0] - 0.2, 0.2 * point[1] + 0.4, point[2]);
  return mesh;
}
Vec3 slid(double time, const Vec3& point) { return point + Vec3(0.6 * time, 0.05 * time, 0); }
Vec3 pressed(double time, const Vec3& point) { return slid(time, point)[0] >= 0 && slid(time, point)[0] <= 1 ? Vec3(0.1, -0.02, -1) : Vec3::Zero(); }

Blade slider_under_pressure() { return {slider(), slid, pressed}; }

// A disc of eight corners that turns on the receiver, 0.7 radians a window, about a point beside its middle. Its forces are given in axes that turn with it.
const Vec3 pivot(0.5, 0.45, 0.01);
geometry::SurfaceMesh octagon() {
  geometry::SurfaceMesh mesh;
  mesh.points.emplace_back(0.5, 0.5, 0.01);
  for (int k = 0; k < 8; ++k) mesh.points.emplace_back(0.5 + 0.3 * std::cos(k * M_PI / 4), 0.5 + 0.3 * std::sin(k * M_PI / 4), 0.01);
  for (std::uint32_t k = 0; k < 8; ++k) mesh.add_face(geometry::FaceKind::triangle3, std::vector<std::uint32_t>{0, k + 1, (k + 1) % 8 + 1});
  return mesh;
}
Vec3 spun(double time, const Vec3& point) { return pivot + Eigen::AngleAxisd(7 * time, Vec3::UnitZ()) * (point - pivot); }
Vec3 own_force(double, const Vec3& point) { return {std::sin(7 * point[0]), point[1] * point[1], -1 - point[0]}; }
Blade disc_that_turns() { return {octagon(), spun, own_force}; }

TEST_F(Travels, PastAReceiverTheLoadGoesWhereTheSliderIs) {
  auto blade = slider_under_pressure();
  Receiver receiver;
  expect_met(run(case_text(true), blade, receiver, "past"));
  EXPECT_EQ(blade.sends(), (std::vector<std::string>{"force", "displacement"}));
  const auto nodes = stubs::square(4, false).points;
  for (int k = 0; k < windows; ++k) {
    const double time = 0.1 * k + 0.05;
    Vec3 sent = Vec3::Zero(), moment = Vec3::Zero();
    for (const auto& point : slider().points) {
      sent += pressed(time, point);
      moment += slid(time, point).cross(pressed(time, point));
    }
    for (std::size_t n = 0; n < nodes.size(); ++n) {
      sent -= receiver.got[k].force[n];
      moment -= nodes[n].cross(receiver.got[k].force[n]);
    }
    EXPECT_LT(sent.norm(), 1e-13) << k;
    EXPECT_LT(moment.norm(), 1e-13) << k;
  }
  const io::SeriesReader record((folder_ / "past" / "interface.h5").string());
  const auto unmapped = record.scalars("ledger/unmapped");
  EXPECT_EQ(unmapped.front(), 8) << "two columns of four points lie beside the receiver at first, farther than max_distance";
  EXPECT_EQ(unmapped[10], 0);
  EXPECT_LT((record.field("grains.blade", "displacement", 9)[0] - Vec3(0.6, 0.05, 0)).norm(), 1e-15);
}

TEST_F(Travels, ForcesTurnAsTheSurfaceHas) {
  auto blade = disc_that_turns();
  Receiver receiver;
  expect_met(run(case_text(true), blade, receiver));
  const auto nodes = stubs::square(4, false).points;
  for (int k = 0; k < windows; ++k) {
    const double time = 0.1 * k + 0.05;
    const Eigen::AngleAxisd turn(7 * time, Vec3::UnitZ());
    // Midway between a window's ends a point is on the chord, nearer to the pivot than on the arc.
    const double chord = std::cos(0.35);
    Vec3 sent = Vec3::Zero(), moment = Vec3::Zero();
    for (const auto& point : octagon().points) {
      const Vec3 force = turn * own_force(time, point), place = pivot + chord * (spun(time, point) - pivot);
      sent += force;
      moment += place.cross(force);
    }
    for (std::size_t n = 0; n < nodes.size(); ++n) {
      sent -= receiver.got[k].force[n];
      moment -= nodes[n].cross(receiver.got[k].force[n]);
    }
    EXPECT_LT(sent.norm(), 1e-13) << k;
    EXPECT_LT(moment.norm(), 1e-13) << k;
  }
}

TEST_F(Travels, WhatDoesNotSlideIsNotAskedWhereItIs) {
  auto blade = disc_that_turns();
  Receiver receiver;
  expect_met(run(case_text(false), blade, receiver));
  EXPECT_EQ(blade.sends(), std::vector<std::string>{"force"});
  EXPECT_EQ(receiver.got.front().force, receiver.got.back().force) << "in the axes of the surface nothing has changed";
}

TEST_F(Travels, ForcesBesideTheReceiverAreLostAndTheLedgerSaysSo) {
  Blade blade(slider(), slid, [](double, const Vec3&) { return Vec3(0, 0, -1); });
  Receiver receiver;
  const auto outcome = run(case_text(true), blade, receiver);
  expect_ended(outcome, "the mapping from grains.blade to structure.inside lost 0.5 of the force in the window that ends at 0.1 s");
}

TEST_F(Travels, SeveralReceiversShareTheSliderWhereItIs) {
  class Pair : public Receiver {
   public:
    std::vector<protocol::Surface> start(const protocol::Run&) override {
      auto left = stubs::square(4, false), right = stubs::square(4, false);
      for (auto& point : left.points) point[0] *= 0.5;
      for (auto& point : right.points) point[0] = 0.5 + 0.5 * point[0];
      return {{"left", left, {}, {}, {}}, {"right", right, {}, {}, {}}};
    }
  };
  auto blade = slider_under_pressure();
  Pair receiver;
  auto text = case_text(true);
  text.replace(text.find("\"structure.inside\""), 18, "[\"structure.left\", \"structure.right\"]");
  expect_met(run(text, blade, receiver));
  const auto weight = [&](int window, std::size_t surface) {
    double sum = 0;
    for (const auto& force : receiver.got[2 * window + surface].force) sum += force[2];
    return sum;
  };
  EXPECT_NEAR(weight(7, 0), -16, 1e-12);  // from 0.25 to 0.45
  EXPECT_NEAR(weight(7, 1), 0, 1e-12);
  EXPECT_NEAR(weight(14, 0), 0, 1e-12);
  EXPECT_NEAR(weight(14, 1), -16, 1e-12);
}

TEST_F(Travels, WhatCannotBeFollowedEndsTheRun) {
  Receiver receiver;
  Blade soft(octagon(), [](double time, const Vec3& point) -> Vec3 { return point * (1 + 0.01 * time); }, own_force);
  expect_ended(run(case_text(true), soft, receiver), "grains.blade deforms by");
  Blade fast(octagon(), [](double time, const Vec3& point) -> Vec3 { return Eigen::AngleAxisd(11 * time, Vec3(1, 2, 3).normalized()) * point; }, own_force);
  expect_ended(run(case_text(true), fast, receiver), "grains.blade turns by 1.10 radians in a window");
  auto silent = disc_that_turns();
  silent.tells = false;
  expect_ended(run(case_text(true), silent, receiver), "did not send displacement on blade");
}

TEST_F(Travels, WhatTheCaseAsksWronglyIsSaid) {
  const auto expect_said = [](const std::string& text, const std::string& words) {
    try {
      coupler::read_case(io::Table::from_text(text, "case.toml"));
      FAIL() << words;
    } catch (const io::UserError& error) {
      EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
    }
  };
  auto two_way = case_text(true);
  two_way.replace(two_way.find("one-way"), 7, "explicit");
  expect_said(two_way, "slides is for surfaces that move by themselves");
  auto recorded = case_text(true);
  recorded.erase(recorded.find("to = "), 23);
  expect_said(recorded, "slides has a meaning for an interface with `to` only");
}

TEST_F(Travels, AResumedRunIsBitByBitTheOneThatWasNotStopped) {
  for (const auto& [name, make] : {std::pair{"slider", &slider_under_pressure}, {"disc", &disc_that_turns}}) {
    const auto text = case_text(true, "[grains]\ncommand = [\"a\"]\n", "checkpoint_every = 0.4");
    const std::string whole_run = std::string(name) + "-whole", stopped_run = std::string(name) + "-stopped";
    Receiver whole, before, after;
    auto one = make(), two = make(), three = make();
    expect_met(run(text, one, whole, whole_run));
    two.dies_in = 14;
    EXPECT_EQ(run(text, two, before, stopped_run).status, Status::failed);
    expect_met(run(text, three, after, stopped_run, true));
    ASSERT_EQ(after.got.size(), 8u) << "from the checkpoint at 1.2 s on";
    for (std::size_t k = 0; k < after.got.size(); ++k) EXPECT_EQ(after.got[k].force, whole.got[12 + k].force) << name << ", window " << 12 + k;
    const io::SeriesReader a((folder_ / whole_run / "interface.h5").string()), b((folder_ / stopped_run / "interface.h5").string());
    ASSERT_EQ(a.windows(), b.windows());
    for (std::size_t k = 0; k < a.windows(); ++k) EXPECT_EQ(a.field("grains.blade", "displacement", k), b.field("grains.blade", "displacement", k)) << k;
  }
}

TEST_F(Travels, ARecordOfASurfaceThatSlidLoadsAsItDid) {
  for (const auto& [name, make] : {std::pair{"slider", &slider_under_pressure}, {"disc", &disc_that_turns}}) {
    auto blade = make();
    Receiver live, played;
    expect_met(run(case_text(true), blade, live, name));
    expect_met(run(case_text(true, fmt::format("[grains]\nreplay = \"{}\"\n", (folder_ / name).string())), blade, played));
    ASSERT_EQ(live.got.size(), played.got.size());
    for (std::size_t k = 0; k < live.got.size(); ++k) EXPECT_EQ(live.got[k].force, played.got[k].force) << name << ", window " << k;
  }
  // What was not followed then cannot be now.
  auto blade = disc_that_turns();
  Receiver receiver;
  expect_met(run(case_text(false), blade, receiver, "unfollowed"));
  protocol::Run again;
  again.uses = {{"blade", {}, {"force", "displacement"}}};
  coupler::Replay replay({(folder_ / "unfollowed").string(), {}, {}, {}, 0}, "grains");
  try {
    replay.start(again);
    FAIL();
  } catch (const io::UserError& error) {
    EXPECT_NE(std::string(error.what()).find("the record holds no motion of grains.blade"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace acopla
