// The bodies of docs/protocol.md §4: what is written is read back, what cannot be used is refused
// by name.
#include <gtest/gtest.h>

#include <cmath>

#include "io/error.h"
#include "protocol/channel.h"
#include "protocol/exchange.h"
#include "tests/unit/protocol/frames.h"

namespace acopla::protocol {
namespace {

using geometry::FaceKind;
using geometry::Vec3;

Message trip(const Message& message) { return decode(frames_of(message, 4)); }

template <class Read>
void expect_refused(const Message& message, Read read, const std::string& words) {
  try {
    read(message);
    FAIL() << "accepted; expected: " << words;
  } catch (const ProtocolError& error) {
    EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
  }
}

geometry::SurfaceMesh mixed_surface() {
  geometry::SurfaceMesh mesh;
  for (int k = 0; k < 9; ++k) mesh.points.emplace_back(k % 3, k / 3, 0.1 * k);
  mesh.add_face(FaceKind::triangle3, std::vector<std::uint32_t>{0, 1, 3});
  mesh.add_face(FaceKind::quad9, std::vector<std::uint32_t>{0, 2, 8, 6, 1, 5, 7, 3, 4});
  mesh.add_face(FaceKind::line2, std::vector<std::uint32_t>{7, 8});
  return mesh;
}

TEST(Exchange, Hello) {
  const auto hello = read_hello(trip(hello_message("grains", {"dem", 2, {"save"}})));
  EXPECT_EQ(hello.participant, "grains");
  EXPECT_EQ(hello.introduction.solver, "dem");
  EXPECT_EQ(hello.introduction.dimension, 2);
  EXPECT_EQ(hello.introduction.capabilities, std::vector<std::string>{"save"});
  EXPECT_EQ(hello.version_low, 1u);
  EXPECT_EQ(hello.version_high, 1u);
}

TEST(Exchange, HelloIsCheckedKeyByKey) {
  const auto with = [](const char* key, const Body& value) {
    auto message = hello_message("grains", {"dem", 2, {}});
    message.body[key] = value;
    return message;
  };
  expect_refused(with("participant", 7), read_hello,
                 "\"participant\" of hello is of the wrong type");
  expect_refused(with("dimension", 2.5), read_hello, "\"dimension\" of hello is not an integer");
  expect_refused(with("dimension", (std::int64_t{1} << 32) + 3), read_hello,
                 "not an integer in range");
  expect_refused(with("versions", {1}), read_hello, "must be [lowest, highest]");
  expect_refused(with("versions", {1e300, 1e300}), read_hello, "must be [lowest, highest]");
  expect_refused(with("versions", {-1, 1}), read_hello, "must be [lowest, highest]");
  expect_refused(with("capabilities", {1, 2}), read_hello, "wrong type");
  auto message = hello_message("grains", {"dem", 2, {}});
  message.body.erase("solver");
  expect_refused(message, read_hello, "hello lacks \"solver\"");
}

TEST(Exchange, Welcome) {
  protocol::Run run;
  run.tick = 0.05;
  run.end = 60;
  run.window = 1;
  run.gravity[2] = -9.81;
  run.results = "/tmp/x/grains";
  run.uses = {{"box", {"displacement"}, {"force"}}};
  const auto welcome = read_welcome(trip(welcome_message(run, "ipc:///tmp/x/hub.pulse")));
  EXPECT_EQ(welcome.run.tick, 0.05);
  EXPECT_EQ(welcome.run.end, 60);
  EXPECT_EQ(welcome.run.gravity[2], -9.81);
  EXPECT_EQ(welcome.run.results, "/tmp/x/grains");
  ASSERT_EQ(welcome.run.uses.size(), 1u);
  EXPECT_EQ(welcome.run.uses[0].receives[0], "displacement");
  EXPECT_EQ(welcome.run.uses[0].sends[0], "force");
  EXPECT_EQ(welcome.pulse_endpoint, "ipc:///tmp/x/hub.pulse");
  EXPECT_FALSE(welcome.run.wants_mass);
  run.wants_mass = true;
  EXPECT_TRUE(read_welcome(trip(welcome_message(run, ""))).run.wants_mass);
  auto message = welcome_message(run, "");
  for (const double tick : {0.0, -1.0, std::nan(""), HUGE_VAL}) {
    message.body["tick"] = tick;
    expect_refused(message, read_welcome, "\"tick\" of welcome is not positive");
  }
}

TEST(Exchange, InterfaceKeepsAllKindsOfFaces) {
  const auto sent = mixed_surface();
  const auto read = read_interface(trip(interface_message({{"box", sent}, {"cloud", {}}})));
  ASSERT_EQ(read.size(), 2u);
  EXPECT_EQ(read[0].name, "box");
  EXPECT_EQ(read[0].mesh.points, sent.points);
  EXPECT_EQ(read[0].mesh.kinds(), sent.kinds());
  EXPECT_EQ(read[0].mesh.connectivity(), sent.connectivity());
  EXPECT_TRUE(read[1].mesh.points.empty());
}

TEST(Exchange, InterfaceThatDoesNotFitTogetherIsRefused) {
  const auto with = [](std::vector<std::int32_t> nodes, std::vector<std::uint8_t> faces) {
    auto message = interface_message({{"box", mixed_surface()}});
    const std::uint64_t node_count = nodes.size(), face_count = faces.size();
    message.arrays[1] = Array::of("nodes", "box", {node_count}, std::move(nodes));
    message.arrays[2] = Array::of("kinds", "box", {face_count}, std::move(faces));
    return message;
  };
  EXPECT_NO_THROW(read_interface(with({0, 1, 2}, {3})));
  expect_refused(with({0, 1}, {3}), read_interface, "fewer nodes");
  expect_refused(with({0, 1, 2, 3}, {3}), read_interface, "more nodes");
  expect_refused(with({0, 1, 2}, {99}), read_interface, "unknown kind 99");
  expect_refused(with({0, 1, 9}, {3}), read_interface, "surface box");
  expect_refused(with({0, 1, -1}, {3}), read_interface, "surface box");
  auto missing = interface_message({{"box", mixed_surface()}});
  missing.body["surfaces"] = {"other"};
  expect_refused(missing, read_interface, "lacks the array points of surface other");
}

TEST(Exchange, FieldsOfAnAdvanceSurvive) {
  const std::vector<Field> fields{{"box", "force", {{1, 2, 3}, {4, 5, 6}}},
                                  {"lid", "displacement", {}}};
  const std::vector<Run::Use> uses{{"box", {"force"}, {}}, {"lid", {"displacement", "velocity"}, {}}};
  const auto request = read_advance(trip(advance_message({3, 5, 0.3, 0.2}, fields)), uses);
  EXPECT_EQ(request.start, 3);
  EXPECT_EQ(request.end, 5);
  ASSERT_EQ(request.fields.size(), 2u);
  EXPECT_EQ(request.fields[0].values[1], Vec3(4, 5, 6));
  const auto read = [&](const Message& message) { return read_advance(message, uses); };
  expect_refused(advance_message({5, 5, 0.5, 0}, {}), read, "no length");
  expect_refused(advance_message({-1, 5, 0.5, 0}, {}), read, "no length");
}

TEST(Exchange, ArraysThatNoUseNamesArePassedOver) {
  auto message = advance_message({3, 5, 0.3, 0.2}, {{"box", "force", {{1, 2, 3}}}, {"box", "heat", {{1, 2, 3}}}, {"lid", "force", {{1, 2, 3}}}});
  message.arrays.push_back(Array::of("label", "box", {2}, std::vector<std::uint8_t>{1, 2}));
  const auto request = read_advance(trip(message), {{"box", {"force"}, {}}});
  ASSERT_EQ(request.fields.size(), 1u);
  EXPECT_EQ(request.fields[0].name, "force");
}

TEST(Exchange, ValuesKeepTheirOrder) {
  Advance advance;
  advance.quantities = {{"z", 1}, {"a", 2}, {"m", -0.5}};
  advance.steps = 1234567890123;
  const auto read = read_advanced(trip(advanced_message(advance)));
  EXPECT_EQ(read.quantities, advance.quantities);
  EXPECT_EQ(read.steps, advance.steps);
  EXPECT_EQ(trip(done_message({{"seconds", 2.5}})).values.front().second, 2.5);
}

TEST(Exchange, WhatIsNotFiniteIsNamed) {
  for (const double value : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
    Advance advance;
    advance.fields = {{"box", "force", {{0, 0, 0}, {0, value, 0}}}};
    expect_refused(trip(advanced_message(advance)), read_advanced,
                   "force on box is not finite at point 1");
  }
}

TEST(Exchange, FieldsAreVectors) {
  Message message = advanced_message({});
  message.arrays.push_back(Array::of("force", "box", {6}, std::vector<double>(6)));
  expect_refused(message, read_advanced, "must have the shape [points, 3]");
  message.arrays[0] = Array::of("force", "box", {2, 3}, std::vector<std::int32_t>(6));
  expect_refused(message, read_advanced, "of type i4, f8 was expected");
}

TEST(Exchange, ErrorsAreReadWhateverTheyLack) {
  const auto error = read_error(trip(error_message("case.toml:1:2: no", "starting", false, true)));
  EXPECT_EQ(error.text, "case.toml:1:2: no");
  EXPECT_EQ(error.state, "starting");
  EXPECT_TRUE(error.mistake);
  EXPECT_FALSE(error.unsupported);
  Message empty;
  empty.body = {{"text", 7}};
  EXPECT_EQ(read_error(empty).text, "");
}

TEST(Endpoints, OnlyLocalOnesAreTaken) {
  for (const char* good : {"ipc:///tmp/x/hub", "inproc://hub", "tcp://127.0.0.1:5555",
                           "tcp://localhost:*", "tcp://[::1]:5555"})
    EXPECT_NO_THROW(check_endpoint(good)) << good;
  for (const char* bad :
       {"tcp://0.0.0.0:5555", "tcp://*:5555", "tcp://10.0.0.1:5555",
        "tcp://localhost.example.org:1", "udp://127.0.0.1:1", "127.0.0.1:5555", "", "tcp://"})
    EXPECT_THROW(check_endpoint(bad), io::UserError) << bad;
  EXPECT_THROW(check_endpoint("ipc:///" + std::string(120, 'x')), io::UserError);
}

}  // namespace
}  // namespace acopla::protocol
