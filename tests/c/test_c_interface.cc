// Calls of protocol/acopla.h in the wrong place or with what cannot be: each says so in a sentence, and the run goes on.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <thread>

#include "protocol/acopla.h"
#include "protocol/exchange.h"
#include "protocol/hub.h"
#include "protocol/pulse.h"

namespace {

using namespace acopla::protocol;
using namespace std::chrono_literals;
using CoupledRun = acopla::protocol::Run;  // testing::Test has one too

class CInterface : public ::testing::Test {
 protected:
  CInterface()
      : endpoint_("ipc:///tmp/acopla-c-test-" + std::to_string(getpid())), hub_(context_, endpoint_), monitor_(context_, endpoint_ + ".pulse") {}
  ~CInterface() override { acopla_close(participant_); }

  Message hear() {
    auto arrival = hub_.receive(5000ms);
    if (!arrival || !arrival->message) throw std::runtime_error("nothing came");
    peer_ = arrival->peer;
    return std::move(*arrival->message);
  }
  void connect(acopla_options options = {}) {
    options.solver = "c";
    options.dimension = 3;
    options.endpoint = endpoint_.c_str();
    options.name = "solver";
    std::thread coupler([this] {
      hello_ = read_hello(hear());
      CoupledRun run;
      run.tick = 0.1;
      run.end = 10;
      run.window = 1;
      run.results = "there";
      run.wants_mass = true;
      run.uses = {{"top", {"force"}, {"displacement"}}};
      hub_.send(peer_, welcome_message(run, monitor_.endpoint()));
    });
    participant_ = acopla_connect(&options);
    coupler.join();
    ASSERT_NE(participant_, nullptr) << acopla_error(nullptr);
  }
  void offer() {
    const double points[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    const unsigned char kind = ACOPLA_TRIANGLE3;
    const std::int32_t nodes[] = {0, 1, 2};
    ASSERT_EQ(acopla_offer_surface(participant_, "top", 3, points, 1, &kind, nodes), 0);
  }
  void say(Message message, std::uint64_t sequence) {
    message.sequence = sequence;
    hub_.send(peer_, message);
  }
  void say(Kind kind, std::uint64_t sequence) {
    Message message;
    message.kind = kind;
    say(message, sequence);
  }
  void expect_fault(int code, const std::string& words) {
    EXPECT_EQ(code, -1);
    EXPECT_EQ(std::string(acopla_error(participant_)), words);
  }

  std::string endpoint_, peer_;
  zmq::context_t context_;
  Hub hub_;
  PulseMonitor monitor_;
  Hello hello_;
  acopla_participant* participant_ = nullptr;
};

TEST_F(CInterface, ARunFromHelloToFinish) {
  int saves = 0;
  acopla_options options{};
  options.self = &saves;
  options.save = [](void* self) { return ++*static_cast<int*>(self), 0; };
  options.restore = [](void*) { return 0; };
  connect(options);
  EXPECT_EQ(hello_.introduction.capabilities, std::vector<std::string>{"save"});
  EXPECT_EQ(acopla_tick(participant_), 0.1);
  EXPECT_EQ(acopla_end(participant_), 10);
  EXPECT_STREQ(acopla_results(participant_), "there");
  EXPECT_EQ(acopla_wants_mass(participant_), 1);
  ASSERT_EQ(acopla_use_count(participant_), 1u);
  EXPECT_STREQ(acopla_use(participant_, 0), "top");
  EXPECT_EQ(acopla_use(participant_, 1), nullptr);
  EXPECT_TRUE(acopla_receives(participant_, "top", "force"));
  EXPECT_FALSE(acopla_receives(participant_, "top", "displacement"));
  EXPECT_TRUE(acopla_sends(participant_, "top", "displacement"));
  offer();
  const double speed[] = {0, 0, 1, 0, 0, 1, 0, 0, 1};
  EXPECT_EQ(acopla_set_initial(participant_, "top", "velocity", speed), 0);
  ASSERT_EQ(acopla_ready(participant_), 0);
  const auto surfaces = read_interface(hear());
  ASSERT_EQ(surfaces.size(), 1u);
  EXPECT_EQ(surfaces[0].velocity[2], Eigen::Vector3d(0, 0, 1));

  say(Kind::save, 1);
  say(advance_message({3, 4, 0, 0}, {{"top", "force", {{1, 2, 3}, {4, 5, 6}, {7, 8, 9}}}}), 2);
  acopla_window window;
  ASSERT_EQ(acopla_next(participant_, &window), 1);
  EXPECT_EQ(saves, 1);
  EXPECT_EQ(hear().kind, Kind::done);
  EXPECT_EQ(window.start, 3);
  EXPECT_NEAR(window.start_time, 0.3, 1e-15);
  EXPECT_NEAR(window.length, 0.1, 1e-15);
  const double* force = acopla_received(participant_, "top", "force");
  ASSERT_NE(force, nullptr);
  EXPECT_EQ(force[5], 6);
  EXPECT_EQ(acopla_received(participant_, "top", "heat"), nullptr);
  EXPECT_EQ(acopla_send(participant_, "top", "displacement", force), 0);
  EXPECT_EQ(acopla_report(participant_, "u", 2.5), 0);
  EXPECT_EQ(acopla_answer(participant_, 7), 0);
  const auto answer = hear();
  EXPECT_EQ(answer.sequence, 2u);
  const auto advance = read_advanced(answer);
  EXPECT_EQ(advance.steps, 7u);
  EXPECT_EQ(advance.fields[0].values[2], Eigen::Vector3d(7, 8, 9));
  EXPECT_EQ(advance.quantities[0].second, 2.5);

  say(folder_message(Kind::checkpoint, "there"), 3);
  say(Kind::finish, 4);
  EXPECT_EQ(acopla_next(participant_, &window), 0);
  EXPECT_TRUE(read_error(hear()).unsupported);
  EXPECT_EQ(acopla_finish(participant_), 0);
  EXPECT_EQ(hear().kind, Kind::done);
  acopla_close(std::exchange(participant_, nullptr));
  EXPECT_FALSE(hub_.receive(200ms).has_value());  // nothing more to say
}

TEST_F(CInterface, CallsInTheWrongPlaceAreNamedAndHarmNothing) {
  connect();
  acopla_window window;
  expect_fault(acopla_next(participant_, &window), "acopla_next() is called after acopla_ready() and before the end");
  expect_fault(acopla_send(participant_, "top", "displacement", nullptr), "fields are sent between acopla_next() and acopla_answer()");
  expect_fault(acopla_answer(participant_, 1), "acopla_answer() without a window");
  expect_fault(acopla_finish(participant_), "acopla_finish() is called when acopla_next() returned 0");
  expect_fault(acopla_set_initial(participant_, "top", "velocity", nullptr), "the surface top was never offered");
  offer();
  const double values[9] = {0, 0, 0, 0, std::nan(""), 0, 0, 0, 0};
  const unsigned char kind = 99;
  const std::int32_t nodes[] = {0, 1, 5};
  expect_fault(acopla_offer_surface(participant_, "side", 3, values, 0, nullptr, nullptr), "points of side is not finite at point 1");
  expect_fault(acopla_offer_surface(participant_, "side", 1, values, 1, &kind, nodes), "face 0 of side is of the unknown kind 99");
  expect_fault(acopla_offer_surface(participant_, "side", 3, nullptr, 0, nullptr, nullptr), "points of side is NULL");
  expect_fault(acopla_set_initial(participant_, "top", "heat", values), "\"heat\" is not an initial field. Use \"displacement\", \"velocity\" or \"mass\"");
  ASSERT_EQ(acopla_ready(participant_), 0);
  expect_fault(acopla_ready(participant_), "acopla_ready() was called before");
  EXPECT_EQ(read_interface(hear()).size(), 1u);
  say(advance_message({0, 1, 0, 0}, {}), 1);
  ASSERT_EQ(acopla_next(participant_, &window), 1);
  EXPECT_EQ(acopla_received(participant_, "top", "force"), nullptr);
  expect_fault(acopla_next(participant_, &window), "the last window was not answered: call acopla_answer() first");
  expect_fault(acopla_send(participant_, "top", "displacement", values), "displacement on top is not finite at point 1");
  expect_fault(acopla_send(participant_, "side", "displacement", values), "the surface side was never offered");
  EXPECT_EQ(acopla_answer(participant_, 1), 0);
  EXPECT_EQ(hear().kind, Kind::advanced);
}

TEST_F(CInterface, AFailureTravelsInItsOwnWordsAndLeavingSaysSo) {
  connect();
  EXPECT_EQ(acopla_fail(participant_, "case.toml:3:1: the mesh is missing.", 1), 0);
  const auto error = read_error(hear());
  EXPECT_EQ(error.text, "case.toml:3:1: the mesh is missing.");
  EXPECT_TRUE(error.mistake);
  acopla_close(participant_);
  connect();
  acopla_close(std::exchange(participant_, nullptr));
  EXPECT_EQ(read_error(hear()).text, "this solver left before the run's end");
}

TEST_F(CInterface, AFailedHandlerEndsTheRun) {
  acopla_options options{};
  options.save = [](void*) { return 28; };
  options.restore = [](void*) { return 0; };
  connect(options);
  offer();
  ASSERT_EQ(acopla_ready(participant_), 0);
  EXPECT_EQ(hear().kind, Kind::interface);
  say(Kind::save, 1);
  acopla_window window;
  expect_fault(acopla_next(participant_, &window), "the solver could not save its state (code 28)");
  EXPECT_EQ(read_error(hear()).text, "the solver could not save its state (code 28)");
  expect_fault(acopla_next(participant_, &window), "acopla_next() is called after acopla_ready() and before the end");
}

TEST(CInterfaceAlone, OptionsThatCannotBeAreNamed) {
  EXPECT_EQ(acopla_connect(nullptr), nullptr);
  EXPECT_STREQ(acopla_error(nullptr), "no options");
  acopla_options options{};
  options.dimension = 4;
  EXPECT_EQ(acopla_connect(&options), nullptr);
  EXPECT_STREQ(acopla_error(nullptr), "dimension = 4 is neither 2 nor 3");
  options.dimension = 2;
  options.save = [](void*) { return 0; };
  EXPECT_EQ(acopla_connect(&options), nullptr);
  EXPECT_STREQ(acopla_error(nullptr), "save and restore belong together: give both or neither");
  options = {};
  options.dimension = 3;
  options.endpoint = "tcp://192.168.0.1:5555";
  options.name = "solver";
  EXPECT_EQ(acopla_connect(&options), nullptr);
  EXPECT_NE(std::string(acopla_error(nullptr)).find("tcp is open to loopback only"), std::string::npos);
  EXPECT_EQ(acopla_next(nullptr, nullptr), -1);
  acopla_close(nullptr);
}

}  // namespace
