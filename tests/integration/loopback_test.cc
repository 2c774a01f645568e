// Coupler and participants in one process, over inproc: the coupled algorithms, their ledgers, and
// what goes wrong.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <optional>
#include <thread>

#include "coupler/coupler.h"
#include "coupler/mapping/mapping.h"
#include "io/series.h"
#include "protocol/channel.h"
#include "protocol/exchange.h"
#include "protocol/pulse.h"
#include "protocol/serve.h"
#include "tests/integration/in_process.h"
#include "tests/integration/stubs.h"

namespace acopla {
namespace {

using coupler::Outcome;
using coupler::Status;
using geometry::Vec3;
using stubs::Mishap;

const char* const participants_text = R"(
[grains]
command = ["a"]
[structure]
command = ["b"]
)";

// A case of ten windows of 0.1 s; `coupling` and `rest` are added to it.
std::string case_text(const std::string& coupling = "",
                      const std::string& rest = participants_text) {
  return R"(
title = "loopback"
dimension = 3
gravity = [0, 0, -9.81]
end = 1.0
[coupling]
scheme = "one-way"
window = 0.1
max_distance = 0.05
)" + coupling +
         R"(
[[coupling.interface]]
from = "grains.box"
to = "structure.inside"
)" + rest;
}

// Keeps the notes too.
class Ear : public in_process::Door {
 public:
  void note(const std::string& text) override {
    const std::lock_guard lock(mutex_);
    notes_.push_back(text);
    changed_.notify_all();
  }
  std::vector<std::string> notes() {
    const std::lock_guard lock(mutex_);
    return notes_;
  }

 private:
  std::vector<std::string> notes_;
};

// What a participant's thread came to.
struct Served {
  std::thread thread;
  std::string error;
};

class Loopback : public ::testing::Test {
 protected:
  // ZeroMQ frees an inproc name some time after its socket is closed: every run has one of its own.
  void next_endpoint() { endpoint = fmt::format("inproc://hub{}", ++runs_); }

  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::temp_directory_path() /
              ("acopla-loopback-" + std::to_string(getpid()) + "-" + std::string(info->name()));
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string results(const std::string& name) {
    const auto path = folder_ / name;
    std::filesystem::create_directories(path);
    return path.string();
  }

  void serve(protocol::Participant& participant, const std::string& name, Served& served) {
    served.thread = std::thread([&, name] {
      ear_.wait_until_open();
      protocol::ServeOptions options{endpoint, name, std::chrono::milliseconds(3000), &context_};
      try {
        protocol::serve(participant, options);
      } catch (const std::exception& error) {
        served.error = error.what();
      }
    });
  }

  // Runs the case with both stubs. `meanwhile` runs beside it, once the coupler is open.
  Outcome run(const std::string& text, const std::string& where = "",
              const std::function<void()>& meanwhile = {}) {
    const auto read =
        coupler::read_case(io::Table::from_text(text, (folder_ / "case.toml").string()));
    next_endpoint();
    ear_.close();
    Served a, b;
    if (const auto* grains = read.find("grains"); grains && !grains->replay)
      serve(sender, "grains", a);
    serve(receiver, "structure", b);
    std::thread beside([&] {
      ear_.wait_until_open();
      if (meanwhile) meanwhile();
    });
    Outcome outcome;
    try {
      outcome = coupler::Coupler(context_, read, {endpoint, where}, ear_).run();
    } catch (const std::exception& error) {  // threads are to be joined all the same
      ADD_FAILURE() << error.what();
    }
    beside.join();
    if (a.thread.joinable()) a.thread.join();
    b.thread.join();
    sender_error = a.error;
    receiver_error = b.error;
    return outcome;
  }

  // What the mapping makes of the stub's forces in a window.
  static std::vector<Vec3> mapped(std::int64_t window) {
    const auto from = stubs::square(7, true, 0.01), to = stubs::square(4, false);
    std::vector<Vec3> sent, received(to.points.size());
    for (std::size_t p = 0; p < from.points.size(); ++p)
      sent.push_back(stubs::known_force(window, p));
    coupler::Mapping(from, to, {0.05}).forces(sent, received);
    return received;
  }

  zmq::context_t context_;
  Ear ear_;
  std::filesystem::path folder_;
  stubs::Sender sender;
  stubs::Receiver receiver;
  std::string sender_error, receiver_error, endpoint;

 private:
  int runs_ = 0;
};

TEST_F(Loopback, HistoryGivesTheReceiverTheMappedForceOfEveryWindowBitForBit) {
  const auto outcome = run(case_text());
  EXPECT_EQ(outcome.status, Status::met) << outcome.error->message;
  EXPECT_EQ(outcome.windows, 10);
  EXPECT_DOUBLE_EQ(outcome.reached, 1.0);
  ASSERT_EQ(receiver.got.size(), 10u);
  for (std::int64_t k = 0; k < 10; ++k) {
    const auto& got = receiver.got[static_cast<std::size_t>(k)];
    EXPECT_EQ(got.window.start, k);
    EXPECT_NEAR(got.window.length, 0.1, 1e-15);
    EXPECT_EQ(got.force, mapped(k));
  }
  EXPECT_EQ(outcome.participants[0].steps, 100u);
  EXPECT_EQ(outcome.participants[1].steps, 10u);
  EXPECT_GT(outcome.participants[0].peak_bytes, 1u << 20);
}

TEST_F(Loopback, ParticipantsAreToldOfTheRunWhatTheyNeedAndNoMore) {
  run(case_text());
  EXPECT_EQ(sender.run().end, 10);
  EXPECT_DOUBLE_EQ(sender.run().tick, 0.1);
  EXPECT_DOUBLE_EQ(sender.run().gravity[2], -9.81);
  ASSERT_EQ(sender.run().uses.size(), 1u);
  EXPECT_EQ(sender.run().uses[0].surface, "box");
  EXPECT_EQ(sender.run().uses[0].sends, std::vector<std::string>{"force"});
  EXPECT_TRUE(sender.run().uses[0].receives.empty());
  EXPECT_EQ(receiver.run().uses[0].receives, std::vector<std::string>{"force"});
}

TEST_F(Loopback, SnapshotGivesOneWindowOnce) {
  const auto outcome = run(case_text("loads = \"snapshot\"\nat = 0.7"));
  EXPECT_EQ(outcome.status, Status::met);
  ASSERT_EQ(receiver.got.size(), 1u);
  EXPECT_EQ(receiver.got[0].window.start, 6);
  EXPECT_EQ(receiver.got[0].window.end, 7);
  EXPECT_EQ(receiver.got[0].force, mapped(6));
}

TEST_F(Loopback, MeanGivesTheMeanOverItsWindowsOnce) {
  run(case_text("loads = \"mean\"\nover = 0.3"));
  ASSERT_EQ(receiver.got.size(), 1u);
  EXPECT_EQ(receiver.got[0].window.start, 7);
  EXPECT_EQ(receiver.got[0].window.end, 10);
  const auto a = mapped(7), b = mapped(8), c = mapped(9);
  for (std::size_t p = 0; p < a.size(); ++p)  // round-off of three additions
    EXPECT_LT((receiver.got[0].force[p] - (a[p] + b[p] + c[p]) / 3).norm(), 1e-14);
}

TEST_F(Loopback, ARunningMeanIsOverTheLastWindows) {
  run(case_text("loads = \"running_mean\"\nover = 0.3\nloads_from = 0.1"));
  ASSERT_EQ(receiver.got.size(), 9u);
  for (int window = 1; window < 10; ++window) {
    const auto& got = receiver.got[static_cast<std::size_t>(window - 1)];
    EXPECT_EQ(got.window.start, window);
    const int first = std::max(0, window - 2);
    for (std::size_t p = 0; p < got.force.size(); ++p) {
      geometry::Vec3 sum = geometry::Vec3::Zero();
      for (int k = first; k <= window; ++k) sum += mapped(k)[p];
      EXPECT_LT((got.force[p] - sum / (window + 1 - first)).norm(), 1e-14) << window;
    }
  }
}

// Node by node the window whose force is largest there.
TEST_F(Loopback, APeakIsTheLargestForceOfEachNode) {
  run(case_text("loads = \"peak\"\nat = 0.9\nover = 0.5"));
  ASSERT_EQ(receiver.got.size(), 1u);
  EXPECT_EQ(receiver.got[0].window.start, 4);
  EXPECT_EQ(receiver.got[0].window.end, 9);
  for (std::size_t p = 0; p < receiver.got[0].force.size(); ++p) {
    auto largest = mapped(4)[p];
    for (int k = 5; k < 9; ++k)
      if (mapped(k)[p].norm() > largest.norm()) largest = mapped(k)[p];
    EXPECT_EQ(receiver.got[0].force[p], largest);
  }
}

TEST_F(Loopback, LoadsFromSkipsEarlierWindows) {
  run(case_text("loads_from = 0.6"));
  ASSERT_EQ(receiver.got.size(), 4u);
  EXPECT_EQ(receiver.got[0].window.start, 6);
  EXPECT_EQ(receiver.got[0].force, mapped(6));
}

TEST_F(Loopback, SeveralInterfacesOnOneSurfaceAdd) {
  run(case_text(), results("first"));
  receiver.got.clear();
  const auto outcome = run(case_text("", R"(
[[coupling.interface]]
from = "again.box"
to = "structure.inside"
[again]
replay = { file = "first", of = "grains" }
)" + std::string(participants_text)));
  EXPECT_EQ(outcome.status, Status::met) << outcome.error->message;
  ASSERT_EQ(receiver.got.size(), 10u);
  const auto once = mapped(5);
  for (std::size_t p = 0; p < once.size(); ++p) EXPECT_EQ(receiver.got[5].force[p], 2 * once[p]);
  EXPECT_EQ(outcome.interfaces.size(), 2u);
}

TEST_F(Loopback, LedgersAreAtRoundOffAndAllIsRecorded) {
  const auto where = results("run");
  const auto outcome = run(case_text("output_every = 0.5"), where);
  EXPECT_LT(outcome.ledgers.force_loss, 1e-14);
  EXPECT_LT(outcome.ledgers.moment_loss, 1e-14);
  EXPECT_EQ(outcome.ledgers.unmapped, 0);
  EXPECT_NEAR(outcome.ledgers.worst_distance, 0.01, 1e-12);  // the stubs' gap
  io::SeriesReader reader(where + "/interface.h5");
  EXPECT_EQ(reader.windows(), 10u);
  EXPECT_EQ(reader.field("structure.inside", "force", 3), mapped(3));
  EXPECT_EQ(reader.scalars("quantities/structure.reaction.z").size(), 10u);
  EXPECT_LT(reader.scalars("ledger/force_loss")[9], 1e-14);
  EXPECT_NEAR(reader.window(9).second, 1.0, 1e-15);
  EXPECT_TRUE(std::filesystem::exists(where + "/surfaces/grains.box_00005.vtp"));
  EXPECT_TRUE(std::filesystem::exists(where + "/grains.box.pvd"));
  std::ifstream stream(where + "/summary.json");
  const auto summary = nlohmann::json::parse(stream);
  EXPECT_EQ(summary["schema"], 1);
  EXPECT_EQ(summary["status"], "met");
  EXPECT_EQ(summary["time"]["windows"], 10);
  EXPECT_TRUE(summary["error"].is_null());
}

TEST_F(Loopback, ALedgerBeyondItsLimitFailsTheRun) {
  // The mean of |F| cannot be kept to a relative 1e-30: round-off alone is more.
  const auto outcome =
      run(case_text("limits = { force_loss = 0, moment_loss = 1e-30 }"), results("run"));
  EXPECT_EQ(outcome.status, Status::failed);
  EXPECT_EQ(outcome.exit_code, io::exit_missed);
  EXPECT_EQ(outcome.error->participant, "grains.box to structure.inside");
  EXPECT_NE(outcome.error->message.find("coupling.limits."), std::string::npos);
  EXPECT_NE(receiver_error.find("the coupler ended the run"), std::string::npos);
}

TEST_F(Loopback, SurfacesTooFarApartAreAUsersMistakeAtTheInterface) {
  sender.height = 0.2;
  const auto outcome = run(case_text());
  EXPECT_EQ(outcome.exit_code, io::exit_user_error);
  EXPECT_NE(
      outcome.error->message.find(
          "case.toml:11:1: 64 of 64 points of grains.box are farther than max_distance = 0.05 m"),
      std::string::npos)
      << outcome.error->message;
}

TEST_F(Loopback, ASurfaceThatIsNotOfferedIsNamedWithTheNearest) {
  auto text = case_text();
  text.replace(text.find("structure.inside"), 16, "structure.insde");
  const auto outcome = run(text);
  EXPECT_EQ(outcome.exit_code, io::exit_user_error);
  EXPECT_NE(
      outcome.error->message.find(
          "case.toml:13:1: structure has no surface \"insde\". Did you mean \"structure.inside\"?"),
      std::string::npos)
      << outcome.error->message;
}

TEST_F(Loopback, ReplayGivesTheReceiverTheSameForcesBitForBit) {
  const auto where = results("first");
  run(case_text(), where);
  const auto first = receiver.got;
  receiver.got.clear();
  const auto outcome = run(
      case_text("", "[grains]\nreplay = \"first/interface.h5\"\n[structure]\ncommand = [\"b\"]\n"));
  EXPECT_EQ(outcome.status, Status::met) << outcome.error->message;
  ASSERT_EQ(receiver.got.size(), first.size());
  for (std::size_t k = 0; k < first.size(); ++k) EXPECT_EQ(receiver.got[k].force, first[k].force);
  EXPECT_EQ(outcome.participants[0].solver, "replay");
}

TEST_F(Loopback, ReplayShiftsPartsAndIsSilentOutside) {
  run(case_text(), results("first"));
  receiver.got.clear();
  run(case_text("",
                "[grains]\nreplay = { file = \"first\", from = 0.6, to = 0.8, at = 0.3 "
                "}\n[structure]\ncommand = [\"b\"]\n"));
  ASSERT_EQ(receiver.got.size(), 10u);
  EXPECT_EQ(receiver.got[3].force, mapped(6));
  EXPECT_EQ(receiver.got[4].force, mapped(7));
  for (const std::size_t k : {0u, 2u, 5u, 9u})
    for (const auto& f : receiver.got[k].force) EXPECT_EQ(f, Vec3::Zero());
}

TEST_F(Loopback, ReplayInOtherWindowsKeepsTheImpulse) {
  run(case_text(), results("first"));
  receiver.got.clear();
  auto text = case_text("", "[grains]\nreplay = \"first\"\n[structure]\ncommand = [\"b\"]\n");
  text.replace(text.find("window = 0.1"), 12, "window = 0.25");
  run(text);
  ASSERT_EQ(receiver.got.size(), 4u);
  const auto a = mapped(0), b = mapped(1), c = mapped(2);
  for (std::size_t p = 0; p < a.size();
       ++p)  // a mean of recorded means, to the round-off of the mapping
    EXPECT_LT((receiver.got[0].force[p] - (0.4 * a[p] + 0.4 * b[p] + 0.2 * c[p])).norm(), 1e-13);
}

TEST_F(Loopback, AParticipantAloneNeedsOnlyItsWindows) {
  const std::string alone = R"(
dimension = 3
end = 1.0
[coupling]
window = 0.1
[structure]
command = ["b"]
[expect]
"structure.reaction.z" = { value = 0, absolute = 0, source = "nobody loads it" }
)";
  const auto outcome = run(alone, results("alone"));
  EXPECT_EQ(outcome.status, Status::met);
  EXPECT_EQ(outcome.windows, 10);
  EXPECT_TRUE(outcome.interfaces.empty());
  // With somebody else in the case there must be something between them.
  auto two = alone;
  two.replace(two.find("window = 0.1"), 12, "scheme = \"one-way\"\nmax_distance = 1\nwindow = 0.1");
  two += "[grains]\ncommand = [\"a\"]\n";
  try {
    coupler::read_case(io::Table::from_text(two, "case.toml"));
    FAIL() << "two participants and no interface";
  } catch (const io::UserError& error) {
    EXPECT_NE(
        std::string(error.what()).find("no [[coupling.interface]], and there are 2 participants"),
        std::string::npos)
        << error.what();
  }
}

TEST_F(Loopback, ExpectationsReadTheLastWindowOrTheMean) {
  double last = 0, mean = 0;
  for (std::size_t p = 0; p < 64; ++p) {
    last -= stubs::known_force(9, p)[2];
    mean -= (stubs::known_force(8, p)[2] + stubs::known_force(9, p)[2]) / 2;
  }
  const auto expect = fmt::format(R"([expect]
"structure.reaction.z" = {{ value = {:.15g}, relative = 1e-12 }}
"grains.box.force.z" = {{ value = {:.15g}, absolute = 1e-9, mean_over = 0.2, source = "sum by hand" }}
"structure.seconds.solve" = {{ value = 0.5, relative = 0 }}
)",
                                  last, -mean);
  auto outcome = run(case_text("", participants_text + expect));
  EXPECT_EQ(outcome.status, Status::met);
  ASSERT_EQ(outcome.expectations.size(), 3u);
  EXPECT_NEAR(*outcome.expectations[0].value, last, 1e-9);
  outcome = run(
      case_text("", std::string(participants_text) +
                        "[expect]\n\"structure.reaction.z\" = { value = 1, relative = 0.1 }\n"));
  EXPECT_EQ(outcome.status, Status::missed);
  EXPECT_EQ(outcome.exit_code, io::exit_missed);
  outcome =
      run(case_text("", std::string(participants_text) +
                            "[expect]\n\"structure.reacton.z\" = { value = 1, relative = 0.1 }\n"));
  EXPECT_EQ(outcome.status, Status::missed);
  EXPECT_FALSE(outcome.expectations[0].value.has_value());
}

TEST_F(Loopback, BothSidesWorkAtTheSameTime) {
  sender.pause = receiver.pause = std::chrono::milliseconds(60);
  const auto outcome = run(case_text());
  // One after the other would take 1.2 s; overlapped it is 0.66 s. The margin is for a busy
  // machine.
  EXPECT_LT(outcome.seconds, 1.05);
}

// --- what goes wrong ---

TEST_F(Loopback, AnExceptionIsToldWithItsStateAndTheOtherIsDismissed) {
  sender.mishap = {4, Mishap::Kind::exception};
  const auto where = results("run");
  const auto outcome = run(case_text(), where);
  EXPECT_EQ(outcome.status, Status::failed);
  EXPECT_EQ(outcome.exit_code, io::exit_failure);
  EXPECT_EQ(outcome.error->participant, "grains");
  EXPECT_EQ(outcome.error->state, "advancing from 0.4 s to 0.5 s");
  EXPECT_NE(outcome.error->message.find("the stub was told to fail"), std::string::npos);
  EXPECT_NE(receiver_error.find("the coupler ended the run"), std::string::npos);
  EXPECT_LE(outcome.windows, 4);
  EXPECT_EQ(io::SeriesReader(where + "/interface.h5").windows(),
            static_cast<std::size_t>(outcome.windows));
}

TEST_F(Loopback, AUsersMistakeInsideASolverTravelsVerbatim) {
  receiver.mishap = {2, Mishap::Kind::user_error};
  const auto outcome = run(case_text());
  EXPECT_EQ(outcome.exit_code, io::exit_user_error);
  EXPECT_EQ(outcome.error->message, "case.toml:7:3: stub.key = 3 is wrong. Use 4.");
}

TEST_F(Loopback, FieldsThatCannotBeUsedAreNamedWithTheirSender) {
  const std::pair<Mishap::Kind, const char*> cases[] = {
      {Mishap::Kind::not_finite, "force on box is not finite at point 3"},
      {Mishap::Kind::forget_force, "did not send force on box"},
      {Mishap::Kind::wrong_size, "63 values for 64 points"}};
  for (const auto& [kind, words] : cases) {
    sender.mishap = {1, kind};
    const auto outcome = run(case_text());
    EXPECT_EQ(outcome.status, Status::failed);
    EXPECT_EQ(outcome.error->participant, "grains");
    EXPECT_NE(outcome.error->message.find(words), std::string::npos) << outcome.error->message;
  }
}

TEST_F(Loopback, ASecondOfTheSameNameIsRefusedAndTheRunGoesOn) {
  sender.pause = std::chrono::milliseconds(30);
  std::string refused;
  const auto outcome = run(case_text(), "", [&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    stubs::Receiver second;
    try {
      protocol::serve(second, {endpoint, "structure", std::chrono::milliseconds(3000), &context_});
    } catch (const std::exception& error) {
      refused = error.what();
    }
  });
  EXPECT_EQ(outcome.status, Status::met);
  EXPECT_NE(refused.find("structure is connected already"), std::string::npos) << refused;
}

TEST_F(Loopback, StrangersAndGarbageAreAnsweredNotedAndIgnored) {
  sender.pause = std::chrono::milliseconds(30);
  std::vector<std::string> answers;
  const auto outcome = run(case_text(), "", [&] {
    const auto ask = [&](const std::function<void(zmq::socket_t&)>& speak) {
      zmq::socket_t socket(context_, zmq::socket_type::dealer);
      socket.set(zmq::sockopt::linger, 0);
      socket.connect(endpoint);
      speak(socket);
      const auto parcel = protocol::receive_parcel(socket, std::chrono::milliseconds(2000), false);
      answers.push_back(parcel ? protocol::read_error(protocol::decode(parcel->frames)).text
                               : "no answer");
    };
    ask([](auto& socket) {
      socket.send(zmq::str_buffer("garbage \xff\x00 bytes"), zmq::send_flags::none);
    });
    ask([](auto& socket) {
      protocol::send(socket, protocol::hello_message("grans", {"dem", 3, {}}));
    });
    ask([](auto& socket) { protocol::send(socket, protocol::done_message()); });
  });
  EXPECT_EQ(outcome.status, Status::met);
  ASSERT_EQ(answers.size(), 3u);
  EXPECT_NE(answers[0].find("this is not the protocol"), std::string::npos) << answers[0];
  EXPECT_NE(answers[1].find("there is no participant \"grans\" here; there are: grains, structure"),
            std::string::npos)
      << answers[1];
  EXPECT_NE(answers[2].find("done came before hello"), std::string::npos) << answers[2];
  EXPECT_EQ(ear_.notes().size(), 3u);
}

// A participant by hand, for what serve() would never do.
class Rogue {
 public:
  Rogue(zmq::context_t& context, const std::string& endpoint)
      : socket_(context, zmq::socket_type::dealer) {
    socket_.set(zmq::sockopt::linger, 0);
    socket_.connect(endpoint);
  }
  void send(const protocol::Message& message) { protocol::send(socket_, message); }
  void send_raw(const std::string& bytes) {
    socket_.send(zmq::buffer(bytes), zmq::send_flags::none);
  }
  std::optional<protocol::Message> hear() {
    const auto parcel = protocol::receive_parcel(socket_, std::chrono::seconds(20), false);
    return parcel ? std::optional(protocol::decode(parcel->frames)) : std::nullopt;
  }

 private:
  zmq::socket_t socket_;
};

class RogueParticipant : public Loopback {
 protected:
  // Runs the case with `act` in the place of the sender.
  Outcome run_rogue(const std::string& text, const std::function<void(Rogue&)>& act) {
    const auto read = coupler::read_case(io::Table::from_text(text, "case.toml"));
    next_endpoint();
    ear_.close();
    Served b;
    serve(receiver, "structure", b);
    std::thread rogue([&] {
      ear_.wait_until_open();
      Rogue one(context_, endpoint);
      act(one);
    });
    const auto outcome = coupler::Coupler(context_, read, {endpoint, ""}, ear_).run();
    rogue.join();
    b.thread.join();
    return outcome;
  }
  void expect_failure(const Outcome& outcome, const char* words) {
    EXPECT_EQ(outcome.status, Status::failed);
    ASSERT_TRUE(outcome.error.has_value());
    EXPECT_EQ(outcome.error->participant, "grains");
    EXPECT_NE(outcome.error->message.find(words), std::string::npos) << outcome.error->message;
  }
  static protocol::Message hello() { return protocol::hello_message("grains", {"stub", 3, {}}); }
};

TEST_F(RogueParticipant, GarbageOfAKnownPeerFailsTheRunAndNamesIt) {
  expect_failure(run_rogue(case_text(),
                           [](Rogue& rogue) {
                             rogue.send(hello());
                             rogue.hear();
                             rogue.send_raw("\x81\xa1x");
                             rogue.hear();
                           }),
                 "grains (a) sent something that is not the protocol");
}

TEST_F(RogueParticipant, AMessageOutOfTurnNamesSenderStateAndMessage) {
  expect_failure(run_rogue(case_text(),
                           [](Rogue& rogue) {
                             rogue.send(hello());
                             rogue.hear();
                             rogue.send(protocol::done_message());
                             rogue.hear();
                           }),
                 "grains (a) sent done out of turn while starting.");
}

TEST_F(RogueParticipant, AnAnswerToAnotherRequestIsRefused) {
  expect_failure(
      run_rogue(case_text(),
                [](Rogue& rogue) {
                  rogue.send(hello());
                  rogue.hear();
                  rogue.send(protocol::interface_message({{"box", stubs::square(2, true)}}));
                  auto request = rogue.hear();
                  protocol::Message answer = protocol::advanced_message({});
                  answer.sequence = request->sequence + 5;
                  rogue.send(answer);
                  rogue.hear();
                }),
      "answered request 6 while 1 was asked");
}

TEST_F(RogueParticipant, OtherVersionsAndDimensionsAreRefusedByName) {
  expect_failure(run_rogue(case_text(),
                           [](Rogue& rogue) {
                             auto message = hello();
                             message.body["versions"] = {2, 3};
                             rogue.send(message);
                             EXPECT_EQ(rogue.hear()->kind, protocol::Kind::error);
                           }),
                 "speaks protocol versions 2 to 3, this coupler speaks 1");
  expect_failure(run_rogue(case_text(),
                           [](Rogue& rogue) {
                             rogue.send(protocol::hello_message("grains", {"stub", 2, {}}));
                             EXPECT_EQ(rogue.hear()->kind, protocol::Kind::error);
                           }),
                 "works in 2 dimensions, the case has 3");
}

TEST_F(RogueParticipant, APulseThatStopsIsAFreezeWithinTwoSeconds) {
  const auto outcome = run_rogue(case_text(), [&](Rogue& rogue) {
    rogue.send(hello());
    const auto welcome = protocol::read_welcome(*rogue.hear());
    {
      protocol::Pulse pulse(context_, welcome.pulse_endpoint, "grains");
      std::this_thread::sleep_for(std::chrono::milliseconds(700));
    }
    const auto begin = std::chrono::steady_clock::now();
    const auto word = rogue.hear();
    EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::milliseconds(2000));
    ASSERT_TRUE(word.has_value());
    EXPECT_EQ(word->kind, protocol::Kind::error);
  });
  expect_failure(outcome,
                 "has not answered for 1.5 s: its process is frozen or gone while starting.");
}

TEST_F(RogueParticipant, NobodyComing) {
  const auto begin = std::chrono::steady_clock::now();
  expect_failure(run_rogue(case_text("start_limit = 0.5"), [](Rogue&) {}),
                 "did not say hello within 0.5 s (coupling.start_limit)");
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(4));
}

TEST_F(RogueParticipant, NoProgressIsNamedByItsLimit) {
  const auto outcome = run_rogue(
      case_text(
          "", "[grains]\ncommand = [\"a\"]\nadvance_limit = 0.5\n[structure]\ncommand = [\"b\"]\n"),
      [&](Rogue& rogue) {
        rogue.send(hello());
        const auto welcome = protocol::read_welcome(*rogue.hear());
        protocol::Pulse pulse(context_, welcome.pulse_endpoint, "grains");
        rogue.hear();
      });
  expect_failure(outcome,
                 "lives but made no progress for 0.5 s (its advance_limit) while starting.");
}

TEST_F(RogueParticipant, ALargeMeshTravelsWhole) {
  expect_failure(
      run_rogue(
          case_text(),
          [](Rogue& rogue) {
            rogue.send(hello());
            rogue.hear();
            rogue.send(protocol::interface_message(
                {{"box", stubs::square(150, true)}}));  // 22801 points: beyond any header limit
            const auto request = rogue.hear();
            auto answer = protocol::error_message("far enough", "advancing");
            answer.sequence = request->sequence;
            rogue.send(answer);
            EXPECT_EQ(protocol::read_advance(*request, {}).start, 0);
          }),
      "far enough");
}

// --- notices of a launcher ---

class Notices : public coupler::Outside {
 public:
  explicit Notices(coupler::Notice notice) : notice_(std::move(notice)) {}
  std::vector<coupler::Notice> read() override {
    if (++reads_ != 4) return {};
    return {notice_};
  }

 private:
  coupler::Notice notice_;
  int reads_ = 0;
};

TEST(Launcher, NoticesOfExitsAndInterruptsEndTheRun) {
  for (const bool interrupt : {false, true}) {
    zmq::context_t context;
    coupler::Reporter silent;
    const auto read = coupler::read_case(io::Table::from_text(case_text(), "case.toml"));
    Notices notices(interrupt ? coupler::Notice{}
                              : coupler::Notice{coupler::Notice::Kind::exited, "grains",
                                                "was killed by signal 11 (Segmentation fault)",
                                                false, ""});
    const auto outcome =
        coupler::Coupler(context, read, {"inproc://hub", "", &notices}, silent).run();
    EXPECT_EQ(outcome.status, interrupt ? Status::interrupted : Status::failed);
    EXPECT_EQ(outcome.exit_code, interrupt ? io::exit_interrupted : io::exit_failure);
    EXPECT_EQ(outcome.error->message,
              interrupt
                  ? "the run was interrupted"
                  : "grains (a) was killed by signal 11 (Segmentation fault) while not connected.");
  }
}

TEST(Launcher, NoticesSurviveTheirLine) {
  const coupler::Notice notice{coupler::Notice::Kind::exited, "grains", "was \"killed\"\nby \xff",
                               true, "case.toml:1:2: é"};
  const auto line = coupler::to_line(notice);
  EXPECT_EQ(std::count(line.begin(), line.end(), '\n'), 1);
  const auto back = coupler::notice_from_line(line);
  EXPECT_EQ(back.participant, "grains");
  EXPECT_TRUE(back.mistake);
  EXPECT_EQ(back.last_words, notice.last_words);
}

}  // namespace
}  // namespace acopla
