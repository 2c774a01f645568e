// What the coupler reads of a case, and what it refuses.
#include "coupler/case.h"
#include "tests/unit/io/scratch.h"

namespace acopla::coupler {
namespace {

using io::expect_mistake;

const std::string good = R"(title = "box"
dimension = 3
gravity = [0, 0, -9.81]
end = 3.0
[coupling]
scheme = "one-way"
window = 0.05
max_distance = 0.02
[[coupling.interface]]
from = "grains.box"
to = "structure.inside"
[grains]
solver = "dem"
advance_limit = 100
anything = "is checked by its solver"
[structure]
solver = "fem"
[expect]
"structure.reaction.z" = { value = 1643.73, relative = 2e-4, mean_over = 0.2, source = "weight" }
)";

std::string with(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

Case parse(const std::string& text) { return read_case(io::Table::from_text(text, "case.toml")); }
void expect_refused(const std::string& from, const std::string& to, const std::string& words) {
  expect_mistake([&] { parse(with(good, from, to)); }, words);
}

TEST(CouplingCase, ReadsAll) {
  const auto read = parse(good);
  EXPECT_EQ(read.title, "box");
  EXPECT_EQ(read.windows, 60);
  EXPECT_EQ(read.loads, Loads::history);
  ASSERT_EQ(read.participants.size(), 2u);
  EXPECT_EQ(read.participants[0].solver, "dem");
  EXPECT_EQ(*read.participants[0].advance_limit, 100);
  EXPECT_TRUE(read.sends("grains"));
  EXPECT_TRUE(read.receives("structure"));
  EXPECT_EQ(read.interfaces[0].text(), "grains.box to structure.inside");
  EXPECT_EQ(read.limits.force_loss, 1e-12);
  EXPECT_EQ(read.expectations[0].name, "structure.reaction.z");
  EXPECT_EQ(read.expectations[0].at, 3.0);
  EXPECT_EQ(read.output_every, 3);  // a twentieth of the run
}

TEST(CouplingCase, ThreeSecondsAreSixtyWindowsWhateverTheirRoundOff) {
  EXPECT_EQ(parse(with(good, "end = 3.0", "end = 5.0")).windows, 100);
  EXPECT_EQ(
      parse(with(with(good, "end = 3.0", "end = 0.3"), "window = 0.05", "window = 0.1")).windows,
      3);
  EXPECT_EQ(
      parse(with(with(good, "end = 3.0", "end = 5.0"), "window = 0.05", "window = 0.01")).windows,
      500);
}

TEST(CouplingCase, AnEndThatIsNoWholeNumberOfWindowsNamesThoseThatAre) {
  expect_refused("end = 3.0", "end = 3.02",
                 "case.toml:4:1: end = 3.02 s is 60.4 windows of 0.05 s, not a whole number. Use 3 "
                 "s or 3.05 s");
}

TEST(CouplingCase, MisspeltKeysNameTheNearest) {
  expect_refused("title", "tilte", "case.toml:1:1: tilte is not a known key. Did you mean title?");
  expect_refused("dimension", "dimenson",
                 "case.toml:2:1: dimenson is not a known key. Did you mean dimension?");
  expect_refused("max_distance", "max_distanse",
                 "case.toml:8:1: coupling.max_distanse stands where max_distance is missing.");
  expect_refused("[coupling]\n", "[coupling]\nstart_limt = 3\n",
                 "coupling.start_limt is not a known key. Did you mean start_limit?");
  expect_refused("mean_over", "mean_ovr", "Did you mean mean_over?");
  expect_refused("[grains]\nsolver = \"dem\"", "[grains]\n",
                 "case.toml:12:1: grains is not a known key, and as a participant it lacks solver");
  expect_refused("[expect]", "[expct]", "Did you mean expect?");
}

TEST(CouplingCase, NamesThatDoNotExist) {
  expect_refused("grains.box\"", "grans.box\"",
                 "case.toml:10:1: coupling.interface[0].from = \"grans.box\" names a participant "
                 "that does not "
                 "exist. Did you mean \"grains.box\"?");
  expect_refused("\"grains.box\"", "\"grains\"", "is not a surface. Write participant.surface");
  expect_refused("\"structure.reaction.z\"", "\"strcture.reaction.z\"",
                 "names no quantity of a participant");
  expect_refused("\"structure.inside\"", "\"grains.lid\"", "is the participant that sends");
}

TEST(CouplingCase, OutOfRange) {
  expect_refused("window = 0.05", "window = 0",
                 "case.toml:7:1: coupling.window = 0 is outside (0, inf).");
  expect_refused("window = 0.05", "window = nan", "is not a finite number");
  expect_refused("window = 0.05", "window = 1e-300", "more than this program can count");
  expect_refused("window = 0.05", "window = \"auto\"",
                 "finds the longest windows in which scheme = \"explicit\" is stable");
  expect_refused("dimension = 3", "dimension = 4", "dimension = 4 is outside [2, 3].");
  expect_refused("dimension = 3", "dimension = 2", "gravity must have 2 components, not 3.");
  expect_refused("max_distance = 0.02", "max_distance = -1",
                 "coupling.max_distance = -1 is outside (0, inf).");
  expect_refused("relative = 2e-4", "relative = 2e-4, absolute = 1", "either relative");
  expect_refused("value = 1643.73", "value = 0.0",
                 "relative has no meaning for an expected value of 0. Use absolute.");
}

TEST(CouplingCase, WhatThisVersionDoesNotDoIsSaid) {
  expect_refused("one-way", "one-wey", "Did you mean \"one-way\"?");
  expect_refused("to = \"structure.inside\"", "to = \"structure.inside\"\nmapping = \"overlp\"", "Did you mean \"overlap\"?");
  expect_refused("to = \"structure.inside\"", "to = \"structure.inside\"\nmotion = \"consistent\"", "has a meaning where surfaces move");
  expect_refused("to = \"structure.inside\"", "to = [\"structure.inside\"]", "lists a surface. Write several, which share the points of `from`, or one without brackets.");
  expect_refused("window = 0.05", "window = \"steps:0\"", "= \"steps:0\" is no window. Write seconds, \"steps:N\"");
  expect_refused("window = 0.05", "window = \"3 steps\"", "is no window");
  expect_refused(
      "[grains]",
      "[[coupling.interface]]\nfrom = \"structure.inside\"\nto = \"grains.box\"\n[grains]",
      "answers with its motion by itself");
}

TEST(CouplingCase, SchemesAndTheirKeys) {
  EXPECT_EQ(parse(with(good, "one-way", "explicit")).scheme, SchemeKind::serial_explicit);
  const auto implicit = parse(with(good, "scheme = \"one-way\"",
                                   "scheme = \"implicit\"\nacceleration = \"aitken\"\ntolerance = { relative = 1e-4, "
                                   "force = 0.1 }\non_fail = \"accept\"\nlimits = { energy_made = 2 }"));
  EXPECT_EQ(implicit.scheme, SchemeKind::serial_implicit);
  EXPECT_EQ(implicit.implicit.acceleration.kind, AccelerationKind::aitken);
  EXPECT_EQ(implicit.implicit.relative, 1e-4);
  EXPECT_EQ(implicit.implicit.force, 0.1);
  EXPECT_FALSE(implicit.implicit.stops);
  EXPECT_EQ(implicit.limits.energy_made, 2);
  expect_refused("scheme = \"one-way\"", "scheme = \"one-way\"\ntolerance = 1e-4",
                 "has a meaning with scheme = \"implicit\" only");
  expect_refused("scheme = \"one-way\"", "scheme = \"parallel\"", "allow_unstable_scheme = true");
  expect_refused("scheme = \"one-way\"", "scheme = \"implicit\"\nmax_iterations = 0", "max_iterations");
}

TEST(CouplingCase, LoadsAndTheirKeys) {
  const auto mean =
      parse(with(good, "window = 0.05", "window = 0.05\nloads = \"mean\"\nover = 0.2\nat = 2.0"));
  EXPECT_EQ(mean.load_start, 36);
  EXPECT_EQ(mean.load_end, 40);
  const auto snapshot = parse(with(good, "window = 0.05", "window = 0.05\nloads = \"snapshot\""));
  EXPECT_EQ(snapshot.load_start, 59);
  EXPECT_EQ(parse(with(good, "window = 0.05", "window = 0.05\nloads_from = 2.8")).loads_from, 56);
  expect_refused("window = 0.05", "window = 0.05\nover = 0.2",
                 "has a meaning with loads = \"mean\", \"running_mean\" or \"peak\" only");
  const auto peak = parse(with(good, "window = 0.05", "window = 0.05\nloads = \"peak\"\nat = 2.0"));
  EXPECT_EQ(peak.load_start, 0);
  EXPECT_EQ(peak.load_end, 40);
  EXPECT_EQ(parse(with(good, "window = 0.05", "window = 0.05\nloads = \"running_mean\"\nover = 0.2")).load_windows, 4);
  expect_refused("window = 0.05", "window = 0.05\nloads = \"running_mean\"", "over");
  expect_refused("window = 0.05", "window = 0.05\nloads = \"peak\"\nover = 5.0", "reaches further back than the start");
  expect_refused("window = 0.05", "window = 0.05\nrecord_motion = true", "has a meaning where surfaces move");
  expect_refused("window = 0.05", "window = 0.05\nloads = \"mean\"\nover = 0.07",
                 "is 1.4 windows of 0.05 s");
  expect_refused("window = 0.05", "window = 0.05\nloads = \"mean\"\nat = 3.5", "is after the end");
  expect_refused("window = 0.05", "window = 0.05\nloads_from = 3.0", "leaves no window to send");
}

TEST(CouplingCase, SubstitutesStandForTheOneThatSends) {
  const auto root = io::Table::from_text(good, "case.toml");
  const auto read = read_case(root, Substitute{"", {"run.h5", "", {}, {}, 0}});
  EXPECT_EQ(read.find("grains")->replay->file, "run.h5");
  EXPECT_TRUE(read.find("grains")->solver.empty());
  expect_mistake(
      [&] {
        read_case(io::Table::from_text(good, "case.toml"),
                  Substitute{"structure", {"run.h5", "", {}, {}, 0}});
      },
      "structure sends no forces");
}

TEST(CouplingCase, AMissingRecordIsLocated) {
  expect_refused("solver = \"dem\"\nadvance_limit = 100\nanything = \"is checked by its solver\"",
                 "replay = \"none.h5\"",
                 "case.toml:13:1: grains.replay = \"none.h5\" does not exist.");
}

}  // namespace
}  // namespace acopla::coupler
