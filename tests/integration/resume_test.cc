// A run that is stopped and resumed from its last checkpoint is bit by bit the run that was not stopped.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "coupler/checkpoint.h"
#include "io/series.h"
#include "tests/integration/in_process.h"
#include "tests/integration/oscillator.h"

namespace acopla {
namespace {

using coupler::Outcome;
using coupler::Status;
namespace fs = std::filesystem;

constexpr int windows = 40, every = 6, stopped_in = 27;

std::string case_text(const std::string& coupling, double end = windows / 32.0, const char* expect = "") {
  return fmt::format(R"(
dimension = 3
end = {}
[coupling]
window = 0.03125
max_distance = 0.1
checkpoint_every = {}
{}
[[coupling.interface]]
from = "first.spring"
to = "second.mass"
[first]
command = ["a"]
[second]
command = ["b"]
[expect]
"second.u" = {{ value = 0, absolute = 10, mean_over = 1 }}
{}
)", end, every / 32.0, coupling, expect);
}

// One that ends the run in the middle of a window, after what was saved and restored in it.
template <class Base>
class Mortal : public Base {
 public:
  int dies_in = -1;
  protocol::Advance advance(const protocol::Window& window, const std::vector<protocol::Field>& received) override {
    if (window.start == dies_in) throw std::runtime_error("the power failed");
    return Base::advance(window, received);
  }
};

// Of the one-way schemes nobody is moved.
class Fixed : public oscillator::Loader {
 public:
  protocol::Advance advance(const protocol::Window& window, const std::vector<protocol::Field>&) override {
    return Loader::advance(window, {{"spring", "displacement", {geometry::Vec3::Zero()}}, {"spring", "velocity", {geometry::Vec3::Zero()}}});
  }
};

class Stopped : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / fmt::format("acopla-resume-{}", getpid());
    fs::remove_all(folder_);
    fs::create_directories(folder_ / "whole");
    fs::create_directories(folder_ / "stopped");
  }
  void TearDown() override { fs::remove_all(folder_); }

  Outcome run(const std::string& text, const std::string& results, bool resumes, int dies_in = -1) {
    static int runs = 0;
    in_process::Door door;
    Mortal<oscillator::Loader> moved;
    Mortal<Fixed> fixed;
    oscillator::Structure second;
    moved.dies_in = fixed.dies_in = dies_in;
    protocol::Participant* first = text.find("one-way") != std::string::npos ? static_cast<protocol::Participant*>(&fixed) : &moved;
    return in_process::run(text, {{"first", first}, {"second", &second}}, fmt::format("inproc://resume-{}", ++runs), door,
                           (folder_ / results).string(), resumes);
  }

  void expect_same_records() const {
    const io::SeriesReader whole(folder_ / "whole" / "interface.h5"), resumed(folder_ / "stopped" / "interface.h5");
    ASSERT_EQ(whole.windows(), resumed.windows());
    for (const char* name : {"quantities/first.u", "quantities/first.v", "quantities/second.u", "ledger/force_loss", "ledger/energy_made"}) {
      const auto a = whole.scalars(name), b = resumed.scalars(name);
      ASSERT_EQ(a.size(), b.size());
      for (std::size_t k = 0; k < a.size(); ++k) {  // NaN: nothing was reported
        if (std::isnan(a[k]) && std::isnan(b[k])) continue;
        ASSERT_EQ(a[k], b[k]) << name << " of window " << k;
      }
    }
    for (std::size_t k = 0; k < whole.windows(); ++k) {
      EXPECT_EQ(whole.window(k), resumed.window(k));
      EXPECT_EQ(whole.field("first.spring", "force", k), resumed.field("first.spring", "force", k)) << k;
    }
  }
  fs::path folder_;
};

class Resumed : public Stopped, public testing::WithParamInterface<const char*> {};

TEST_P(Resumed, IsBitByBitTheRunThatWasNotStopped) {
  const auto text = case_text(GetParam());
  const auto whole = run(text, "whole", false);
  ASSERT_EQ(whole.status, Status::met) << (whole.error ? whole.error->message : "");
  const auto stopped = run(text, "stopped", false, stopped_in);
  ASSERT_EQ(stopped.status, Status::failed);
  EXPECT_NE(stopped.error->message.find("the power failed"), std::string::npos);
  const auto resumed = run(text, "stopped", true);
  ASSERT_EQ(resumed.status, Status::met) << (resumed.error ? resumed.error->message : "");
  EXPECT_EQ(resumed.windows, windows);
  expect_same_records();
  // What the summary says is of all windows.
  ASSERT_TRUE(resumed.expectations.at(0).value);
  EXPECT_EQ(*resumed.expectations.at(0).value, *whole.expectations.at(0).value);
  EXPECT_EQ(resumed.ledgers.energy_made, whole.ledgers.energy_made);
  EXPECT_EQ(resumed.ledgers.iterations, whole.ledgers.iterations);
  EXPECT_EQ(resumed.participants.at(0).steps, whole.participants.at(0).steps);
}
INSTANTIATE_TEST_SUITE_P(Schemes, Resumed,
                         testing::Values("scheme = \"one-way\"", "scheme = \"one-way\"\nloads = \"mean\"\nat = 1.0\nover = 0.5", "scheme = \"one-way\"\nloads = \"running_mean\"\nover = 0.25",
                                         "scheme = \"one-way\"\nloads = \"peak\"", "scheme = \"explicit\"",
                                         "scheme = \"parallel\"\nallow_unstable_scheme = true", "scheme = \"implicit\"\nacceleration = \"aitken\"",
                                         "scheme = \"implicit\"\nacceleration = \"iqn-ils\"\nreuse = 8"));

class Resuming : public Stopped {};

TEST_F(Resuming, GoesOnBeyondTheEndWhenThatIsRaised) {
  const char* scheme = "scheme = \"explicit\"";
  ASSERT_EQ(run(case_text(scheme), "whole", false).status, Status::met);
  ASSERT_EQ(run(case_text(scheme, 0.5), "stopped", false).status, Status::met);
  ASSERT_EQ(run(case_text(scheme), "stopped", true).status, Status::met);
  expect_same_records();
}

TEST_F(Resuming, RefusesWhatIsNotTheSameRun) {
  const auto expect_refusal = [&](const std::string& text, const char* words) {
    try {
      coupler::Checkpoints(coupler::read_case(io::Table::from_text(text, "case.toml")), folder_ / "stopped", true);
      FAIL() << "no error, but " << words;
    } catch (const io::UserError& error) {
      EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
    }
  };
  const char* scheme = "scheme = \"explicit\"";
  expect_refusal(case_text(scheme), "there is no checkpoint to resume from");
  ASSERT_EQ(run(case_text(scheme), "stopped", false).status, Status::met);
  expect_refusal(case_text(scheme), "nothing is left to compute. Raise end");
  expect_refusal(case_text("scheme = \"implicit\"", 2), "is not the case that");
  fs::remove(folder_ / "stopped" / "interface.h5");
  const auto lost = run(case_text(scheme, 2), "stopped", true);
  ASSERT_TRUE(lost.error);
  EXPECT_NE(lost.error->message.find("interface.h5: the record cannot be opened to go on with it"), std::string::npos) << lost.error->message;
}

// Who cannot write checkpoints is not asked to when the first is due, but at once.
TEST_F(Resuming, NeedsEverybodysCapability) {
  class Forgetful final : public oscillator::Structure {
   public:
    protocol::Introduction introduce() const override { return {"oscillator", 3, {"save"}}; }
  };
  in_process::Door door;
  oscillator::Loader first;
  Forgetful second;
  const auto outcome = in_process::run(case_text("scheme = \"explicit\""), {{"first", &first}, {"second", &second}}, "inproc://resume-forgetful", door,
                                       (folder_ / "whole").string());
  ASSERT_TRUE(outcome.error);
  EXPECT_NE(outcome.error->message.find("does not offer \"checkpoint\""), std::string::npos) << outcome.error->message;
}

}  // namespace
}  // namespace acopla
