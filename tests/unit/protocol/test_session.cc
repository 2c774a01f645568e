// The solver's half of the state machine, against a coupler played by the test.
#include <gtest/gtest.h>

#include <stdexcept>
#include <thread>

#include "io/error.h"
#include "protocol/exchange.h"
#include "protocol/hub.h"
#include "protocol/pulse.h"
#include "protocol/serve.h"

namespace acopla::protocol {
namespace {

using std::chrono::milliseconds;

class Solver : public Participant {
 public:
  Introduction introduce() const override { return {"test", 3, {}}; }
  std::vector<Surface> start(const Run&) override {
    if (fails_at_start) throw io::UserError({"case.toml", 3, 1}, "the mesh is missing.");
    return {};
  }
  Advance advance(const Window& window, const std::vector<Field>&) override {
    last = window;
    if (throws) throw std::runtime_error("no convergence");
    Advance advance;
    advance.steps = 3;
    return advance;
  }
  bool fails_at_start = false, throws = false;
  Window last;
};

class Session : public ::testing::Test {
 protected:
  Session() : hub_(context_, "inproc://hub"), monitor_(context_, "inproc://hub.pulse") {}
  ~Session() override {
    if (thread_.joinable()) thread_.join();
  }

  void start(milliseconds patience = milliseconds(3000)) {
    thread_ = std::thread([this, patience] {
      try {
        serve(solver_, {"inproc://hub", "solver", patience, &context_});
        ended_well_ = true;
      } catch (const std::exception& error) {
        thrown_ = error.what();
      }
    });
  }
  Message hear() {
    auto arrival = hub_.receive(milliseconds(5000));
    if (!arrival || !arrival->message) throw std::runtime_error("nothing came");
    peer_ = arrival->peer;
    return std::move(*arrival->message);
  }
  void say(Kind kind, std::uint64_t sequence = 1) {
    Message message;
    message.kind = kind;
    if (kind == Kind::checkpoint || kind == Kind::resume) message = folder_message(kind, "/tmp");
    message.sequence = sequence;
    hub_.send(peer_, message);
  }
  void welcome() {
    EXPECT_EQ(hear().kind, Kind::hello);
    monitor_.expect("solver");
    protocol::Run run;
    run.tick = 0.1;
    run.end = 10;
    hub_.send(peer_, welcome_message(run, "inproc://hub.pulse"));
  }
  void ready() {
    welcome();
    EXPECT_EQ(hear().kind, Kind::interface);
  }
  void end() {
    if (thread_.joinable()) thread_.join();
  }

  zmq::context_t context_;
  Hub hub_;
  PulseMonitor monitor_;
  Solver solver_;
  std::thread thread_;
  std::string peer_, thrown_;
  bool ended_well_ = false;
};

TEST_F(Session, AnswersRequestsWithTheirNumbersUntilFinish) {
  start();
  ready();
  auto advance = advance_message({2, 4, 0, 0}, {});
  advance.sequence = 77;
  hub_.send(peer_, advance);
  const auto answer = hear();
  EXPECT_EQ(answer.kind, Kind::advanced);
  EXPECT_EQ(answer.sequence, 77u);
  EXPECT_EQ(read_advanced(answer).steps, 3u);
  EXPECT_NEAR(solver_.last.start_time, 0.2, 1e-15);
  EXPECT_NEAR(solver_.last.length, 0.2, 1e-15);
  say(Kind::finish, 78);
  const auto done = hear();
  EXPECT_EQ(done.kind, Kind::done);
  EXPECT_EQ(done.sequence, 78u);
  EXPECT_EQ(done.values.back().first, "peak_bytes");
  end();
  EXPECT_TRUE(ended_well_);
}

TEST_F(Session, WhatItCannotDoIsAnsweredAndItGoesOn) {
  start();
  ready();
  std::uint64_t sequence = 0;
  for (const auto kind : {Kind::save, Kind::restore, Kind::checkpoint, Kind::resume}) {
    say(kind, ++sequence);
    const auto answer = hear();
    EXPECT_EQ(answer.kind, Kind::error);
    EXPECT_EQ(answer.sequence, sequence);
    EXPECT_TRUE(read_error(answer).unsupported);
  }
  say(Kind::finish);
  EXPECT_EQ(hear().kind, Kind::done);
  end();
  EXPECT_TRUE(ended_well_);
}

TEST_F(Session, AMessageOutOfTurnEndsItWithSenderStateAndMessage) {
  start();
  ready();
  say(Kind::interface);
  EXPECT_EQ(read_error(hear()).text, "the coupler sent interface to solver while it was ready");
  end();
  EXPECT_FALSE(ended_well_);
}

TEST_F(Session, AnAdvanceBeforeTheWelcomeIsOutOfTurn) {
  start();
  EXPECT_EQ(hear().kind, Kind::hello);
  hub_.send(peer_, advance_message({0, 1, 0, 0}, {}));
  EXPECT_EQ(read_error(hear()).text, "the coupler sent advance to solver while it was connected");
  end();
}

TEST_F(Session, AnExceptionBecomesAnErrorWithItsState) {
  solver_.throws = true;
  start();
  ready();
  hub_.send(peer_, advance_message({1, 2, 0, 0}, {}));
  const auto error = read_error(hear());
  EXPECT_EQ(error.text, "no convergence");
  EXPECT_EQ(error.state, "advancing from 0.1 s to 0.2 s");
  EXPECT_FALSE(error.mistake);
  end();
  EXPECT_EQ(thrown_, "no convergence");
}

TEST_F(Session, AUsersMistakeIsMarked) {
  solver_.fails_at_start = true;
  start();
  welcome();
  const auto error = read_error(hear());
  EXPECT_EQ(error.text, "case.toml:3:1: the mesh is missing.");
  EXPECT_EQ(error.state, "starting");
  EXPECT_TRUE(error.mistake);
  end();
}

TEST_F(Session, TheCouplersErrorEndsItWithoutAnAnswer) {
  start();
  ready();
  hub_.send(peer_, error_message("somebody else failed", "ending"));
  end();
  EXPECT_EQ(thrown_, "the coupler ended the run: somebody else failed");
  EXPECT_FALSE(hub_.receive(milliseconds(100)).has_value());
}

TEST_F(Session, GarbageOfACouplerEndsIt) {
  start();
  ready();
  hub_.socket().send(zmq::buffer(peer_), zmq::send_flags::sndmore);
  hub_.socket().send(zmq::str_buffer("\xff garbage"), zmq::send_flags::none);
  EXPECT_NE(read_error(hear()).text.find("header"), std::string::npos);
  end();
}

TEST_F(Session, ASilentCouplerIsGivenUp) {
  start(milliseconds(300));
  EXPECT_EQ(hear().kind, Kind::hello);
  end();  // no welcome ever comes
  EXPECT_NE(thrown_.find("no sign of a coupler at inproc://hub"), std::string::npos) << thrown_;
}

TEST(Pulse, AStrangerHasNone) {
  zmq::context_t context;
  PulseMonitor monitor(context, "inproc://pulse");
  {
    Pulse stranger(context, "inproc://pulse", "nobody");
    std::this_thread::sleep_for(milliseconds(400));
  }
  std::this_thread::sleep_for(ping_limit + milliseconds(600));
  EXPECT_FALSE(monitor.frozen().has_value());
}

TEST(Pulse, SilenceIsSeenAndForgottenOnRequest) {
  zmq::context_t context;
  PulseMonitor monitor(context, "inproc://pulse");
  monitor.expect("solver");
  {
    Pulse pulse(context, "inproc://pulse", "solver");
    std::this_thread::sleep_for(milliseconds(2000));
    EXPECT_FALSE(monitor.frozen().has_value());
    EXPECT_LT(pulse.silence(), milliseconds(1000));
  }
  std::this_thread::sleep_for(ping_limit + milliseconds(500));
  EXPECT_EQ(monitor.frozen().value_or(""), "solver");
  monitor.forget("solver");
  EXPECT_FALSE(monitor.frozen().has_value());
}

}  // namespace
}  // namespace acopla::protocol
