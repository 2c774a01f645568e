// The codec against docs/protocol.md §2, and against bytes that nobody in their right mind would
// send.
#include <gtest/gtest.h>

#include <limits>
#include <random>

#include "protocol/exchange.h"
#include "tests/unit/protocol/frames.h"

namespace acopla::protocol {
namespace {

const std::vector<Kind> kinds{Kind::hello,    Kind::welcome, Kind::interface, Kind::advance,
                              Kind::advanced, Kind::save,    Kind::restore,   Kind::checkpoint,
                              Kind::resume,   Kind::finish,  Kind::done,      Kind::error,
                              Kind::ping,     Kind::pong};

Message sample(Kind kind) {
  Message message;
  message.kind = kind;
  message.sequence = 0xfedcba9876543210u;
  message.body = {{"null", nullptr},         {"yes", true},
                  {"negative", -7},          {"count", 18446744073709551615u},
                  {"number", 0.1},           {"text", "Σ F = 0"},
                  {"list", {1, "two", 3.0}}, {"map", {{"inner", {1, 2}}}}};
  message.arrays.push_back(
      Array::of("force", "box", {2, 3},
                std::vector<double>{1, 2, 3, 4, 5, std::numeric_limits<double>::infinity()}));
  message.arrays.push_back(Array::of("nodes", "box", {3}, std::vector<std::int32_t>{-1, 0, 7}));
  message.arrays.push_back(Array::of("kinds", "box", {0}, std::vector<std::uint8_t>{}));
  return message;
}

void expect_refused(const std::vector<Frame>& frames, const std::string& words) {
  try {
    decode(frames);
    FAIL() << "accepted; expected: " << words;
  } catch (const ProtocolError& error) {
    EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
  }
}

// A header from a JSON value, through the library that would encode it elsewhere.
Frame header_of(const Body& json) {
  const auto bytes = Body::to_msgpack(json);
  return frame({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

Body plain_header() {
  return {{"acopla", 1},
          {"kind", "ping"},
          {"sequence", 0},
          {"body", Body::object()},
          {"arrays", Body::array()}};
}

TEST(Codec, EveryKindSurvivesTheTrip) {
  for (const auto kind : kinds) {
    const auto sent = sample(kind);
    const auto read = decode(frames_of(sent));
    EXPECT_EQ(read.kind, kind);
    EXPECT_EQ(read.sequence, sent.sequence);
    EXPECT_EQ(read.body, sent.body);
    ASSERT_EQ(read.arrays.size(), 3u);
    EXPECT_EQ(read.find("force", "box")->shape(), (std::vector<std::uint64_t>{2, 3}));
    EXPECT_EQ(read.find("force", "box")->doubles()[4], 5);
    EXPECT_EQ(read.find("nodes", "box")->integers()[0], -1);
    EXPECT_EQ(read.find("kinds", "box")->octets().size(), 0u);
    EXPECT_EQ(read.find("force", "inside"), nullptr);
  }
}

TEST(Codec, ArraysAreReadInPlaceWhereAlignedAndCopiedWhereNot) {
  const auto sent = sample(Kind::advanced);
  for (std::size_t offset = 0; offset < 9; ++offset) {
    const auto frames = frames_of(sent, offset);
    const auto read = decode(frames);
    const auto* data = read.arrays[0].bytes().data();
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(data) % 8, 0u);
    EXPECT_EQ(data == frames[1].data, offset % 8 == 0);
    EXPECT_EQ(read.arrays[0].doubles()[2], 3);
  }
}

TEST(Codec, ValuesOfAnswersAreReadApartAndChecked) {
  auto sent = sample(Kind::advanced);
  sent.values = {{"weight", 2.5}, {"a name that is longer than a short string", -1}, {"weight", std::numeric_limits<double>::infinity()}};
  const auto read = decode(frames_of(sent));
  EXPECT_EQ(read.values, sent.values);
  EXPECT_EQ(read.body, sent.body);
  EXPECT_EQ(Body::from_msgpack(encode_header(sent))["body"]["values"][1][0], "a name that is longer than a short string");

  const auto with = [](const char* kind, const char* values) {
    auto header = plain_header();
    header["kind"] = kind;
    header["body"]["values"] = Body::parse(values);
    return std::vector{header_of(header)};
  };
  EXPECT_EQ(decode(with("done", R"([["steps", 3], ["least", -2], ["half", 0.5]])")).values.at(1).second, -2);
  EXPECT_TRUE(decode(with("done", "[]")).values.empty());
  EXPECT_EQ(decode(with("hello", "7")).body["values"], 7) << "means something there, in another release";
  for (const auto* wrong : {"7", "{}", R"([["name", "text"]])", "[[1, 2]]", R"([["name", 1, 2]])", R"(["name", 1])", R"([["name", null]])"})
    expect_refused(with("advanced", wrong), "\"values\" is not a list of [name, number]");
  using namespace std::string_literals;
  expect_refused({frame("\x85\xa6" "acopla\x01\xa4kind\xa4" "done\xa8sequence\x00\xa4" "body\x82\xa6values\x90\xa6values\x90\xa6" "arrays\x90"s)}, "names \"values\" twice");
}

TEST(Codec, WhatALaterReleaseAddsIsPassedOverOnceItIsWellFormed) {
  auto header = plain_header();
  header["priority"] = {{"of", {1, 2}}};
  header["arrays"] = {{{"name", "force"}, {"mesh", "box"}, {"type", "f8"}, {"shape", {0}}, {"unit", "N"}}};
  EXPECT_EQ(decode(std::vector{header_of(header), frame("")}).arrays.size(), 1u);
  header["priority"] = Body::array({"\xff"});
  expect_refused({header_of(header), frame("")}, "not UTF-8");
}

TEST(Codec, AnArrayOutlivesItsMessageAndFrames) {
  Array kept;
  { kept = decode(frames_of(sample(Kind::advanced))).arrays[0]; }
  EXPECT_EQ(kept.doubles()[1], 2);
}

TEST(Codec, AnotherTypeIsRefusedWhenRead) {
  const auto read = decode(frames_of(sample(Kind::advanced)));
  EXPECT_THROW(read.arrays[0].integers(), ProtocolError);
  EXPECT_THROW(read.arrays[1].octets(), ProtocolError);
  EXPECT_THROW(read.arrays[2].doubles(), ProtocolError);
}

TEST(Codec, HeaderIsMessagePackThatAnyLibraryReads) {
  const auto bytes = encode_header(sample(Kind::advance));
  const auto json = Body::from_msgpack(bytes);
  EXPECT_EQ(json["acopla"], 1);
  EXPECT_EQ(json["kind"], "advance");
  EXPECT_EQ(json["arrays"][0]["shape"], Body({2, 3}));
  EXPECT_EQ(json["arrays"][0]["type"], "f8");
}

TEST(Codec, TruncationAtEveryByteIsAnError) {
  const auto whole = encode_header(sample(Kind::advance));
  const auto rest = frames_of(sample(Kind::advance));
  for (std::size_t length = 0; length < whole.size(); ++length) {
    auto frames = rest;
    frames[0] = frame(whole.substr(0, length));
    EXPECT_THROW(decode(frames), ProtocolError) << length;
  }
  for (std::size_t k = 1; k < rest.size(); ++k)
    for (std::size_t length = 0; length < rest[k].size; ++length) {
      auto frames = rest;
      frames[k].size = length;
      EXPECT_THROW(decode(frames), ProtocolError);
    }
}

TEST(Codec, FramesMustBeAsManyAsTheHeaderNames) {
  auto frames = frames_of(sample(Kind::advance));
  auto fewer = frames;
  fewer.pop_back();
  expect_refused(fewer, "the header names 3 arrays, 2 frames follow");
  frames.push_back(frame("x"));
  expect_refused(frames, "the header names 3 arrays, 4 frames follow");
  expect_refused({}, "without frames");
}

TEST(Codec, BytesAfterTheHeaderAreAnError) {
  auto bytes = encode_header(sample(Kind::ping));
  bytes.push_back('x');
  expect_refused({frame(bytes)}, "follow the header's end");
}

TEST(Codec, DepthIsLimited) {
  std::string nest(100000, '\x91');  // lists in lists
  nest.push_back('\xc0');
  expect_refused({frame(nest)}, "within the limits");
  Body deep = 1;
  for (int k = 0; k < 20; ++k) deep = Body::array({deep});
  auto header = plain_header();
  header["body"]["deep"] = deep;
  expect_refused({header_of(header)}, "within the limits");
}

TEST(Codec, HugeLengthsCostNothing) {
  using namespace std::string_literals;
  for (const auto& start :
       {"\xdd\xff\xff\xff\xff"s, "\xdf\xff\xff\xff\xff"s, "\xdb\xff\xff\xff\xff"s,
        "\xc6\xff\xff\xff\xff"s, "\xc9\xff\xff\xff\xff\x01"s, "\xdc\xff\xff"s, "\xde\xff\xff"s})
    EXPECT_THROW(decode(std::vector{frame(start)}), ProtocolError);
  // Lists of the largest length that is allowed, in one another: the memory asked for stays
  // bounded.
  std::string lists;
  for (int k = 0; k < 15; ++k) lists += "\xdd\x00\x01\x00\x00"s;
  EXPECT_THROW(decode(std::vector{frame(lists)}), ProtocolError);
}

TEST(Codec, HeadersAreLimited) {
  auto header = plain_header();
  header["body"]["long"] = std::string((1 << 20) + 1, 'x');
  expect_refused({header_of(header)}, "over the limit of 1048576");
}

TEST(Codec, KeysAndTypesAreChecked) {
  const auto without = [](const char* key) {
    auto header = plain_header();
    header.erase(key);
    return std::vector{header_of(header)};
  };
  expect_refused(without("acopla"), "no count \"acopla\"");
  expect_refused(without("kind"), "no text \"kind\"");
  expect_refused(without("sequence"), "no count \"sequence\"");
  expect_refused(without("body"), "no map \"body\"");
  expect_refused(without("arrays"), "no list \"arrays\"");
  const auto with = [](const char* key, const Body& value) {
    auto header = plain_header();
    header[key] = value;
    return std::vector{header_of(header)};
  };
  expect_refused(with("acopla", "1"), "no count");
  expect_refused(with("acopla", 2), "a message of protocol version 2, this is version 1");
  expect_refused(with("kind", "explode"), "\"explode\" is not a kind");
  expect_refused(with("sequence", -1), "no count \"sequence\"");
  expect_refused(with("sequence", 1.0), "no count \"sequence\"");
  expect_refused(with("body", Body::array()), "no map \"body\"");
  expect_refused({frame("\x93\x01\x02\x03")}, "not a map");
  expect_refused({frame("\xc1")}, "MessagePack");
  expect_refused({frame(std::string("\x82\x01\x02\x03\x04", 5))}, "a key that is not text");
  expect_refused({frame("\x82\xa1x\x01\xa1x\x02")}, "names \"x\" twice");
  expect_refused({frame(std::string("\x81\xa1x\xc4\x01z", 6))}, "a type the protocol does not use");
}

TEST(Codec, AHelloOfAnotherVersionIsReadSoThatItCanBeAnswered) {
  auto header = plain_header();
  header["acopla"] = 9;
  for (const char* kind : {"hello", "error"}) {
    header["kind"] = kind;
    EXPECT_NO_THROW(decode(std::vector{header_of(header)}));
  }
}

TEST(Codec, TextIsUtf8) {
  auto header = plain_header();
  for (const char* text : {"ab\x7f", "\xc2\x80", "\xe0\xa0\x80", "\xed\x9f\xbf", "\xee\x80\x80", "\xf0\x90\x80\x80", "\xf4\x8f\xbf\xbf"}) {
    header["body"] = {{"text", text}};
    EXPECT_NO_THROW(decode(std::vector{header_of(header)})) << text;
  }
  // Lone continuation, cut short, overlong (2, 3, 4 bytes), surrogate, beyond U+10FFFF (RFC 3629, §3–4).
  for (const char* text : {"\x80", "\xc2", "\xe2\x82", "\xc1\xbf", "\xe0\x9f\xbf", "\xf0\x8f\xbf\xbf", "\xed\xa0\x80", "\xf4\x90\x80\x80", "\xf5\x80\x80\x80"}) {
    header["body"] = {{"text", text}};
    expect_refused({header_of(header)}, "text that is not UTF-8");
  }
}

TEST(Codec, ShapesMustHoldTheirBytes) {
  const auto with_array = [](const Body& array, std::size_t bytes) {
    auto header = plain_header();
    header["arrays"] = Body::array({array});
    return std::vector{header_of(header), frame(std::string(bytes, 'x'))};
  };
  const Body good{{"name", "force"}, {"mesh", "box"}, {"type", "f8"}, {"shape", {2, 3}}};
  EXPECT_NO_THROW(decode(with_array(good, 48)));
  expect_refused(with_array(good, 47), "should have 48 bytes by its shape, but has 47");
  auto changed = good;
  changed["shape"] = {std::uint64_t{1} << 62, 8};  // the product overflows to 0
  expect_refused(with_array(changed, 0), "an impossible shape");
  changed["shape"] = {0, 3};
  EXPECT_NO_THROW(decode(with_array(changed, 0)));
  changed["shape"] = {0, std::uint64_t{1} << 63};  // empty, but readers elsewhere would multiply first
  expect_refused(with_array(changed, 0), "an impossible shape");
  changed["shape"] = {std::uint64_t{1} << 63, 0};
  expect_refused(with_array(changed, 0), "an impossible shape");
  changed["shape"] = {-2, 3};
  expect_refused(with_array(changed, 48), "a shape that is not of counts");
  changed["shape"] = {2.0, 3};
  expect_refused(with_array(changed, 48), "a shape that is not of counts");
  changed["shape"] = std::vector<int>(33, 1);
  expect_refused(with_array(changed, 8), "an impossible shape");
  changed["shape"] = 6;
  expect_refused(with_array(changed, 48), "no list \"shape\"");
  changed = good;
  changed["type"] = "f4";
  expect_refused(with_array(changed, 24), "\"f4\" is not a type");
  changed = good;
  changed.erase("mesh");
  expect_refused(with_array(changed, 48), "no text \"mesh\"");
  expect_refused(with_array("force", 48), "not a map");
}

TEST(Codec, TooManyArraysAreRefused) {
  auto header = plain_header();
  std::vector<Frame> frames{frame("")};
  for (int k = 0; k < 1025; ++k) {
    header["arrays"].push_back({{"name", "a"}, {"mesh", "b"}, {"type", "u1"}, {"shape", {0}}});
    frames.push_back(frame(""));
  }
  frames[0] = header_of(header);
  expect_refused(frames, "1025 arrays in one message");
}

TEST(Codec, RandomMutationsEndInAMessageOrAnError) {
  std::mt19937 random(20110);  // fixed: a failure can be run again
  int messages = 0, errors = 0;
  for (int round = 0; round < 20000; ++round) {
    auto whole = encode_header(sample(kinds[random() % kinds.size()]));
    for (auto changes = 1 + random() % 4; changes > 0; --changes) {
      const auto at = random() % whole.size();
      switch (random() % 4) {
        case 0:
          whole[at] = static_cast<char>(random());
          break;
        case 1:
          whole.erase(at, 1 + random() % 5);
          break;
        case 2:
          whole.insert(at, 1 + random() % 5, static_cast<char>(random()));
          break;
        default:
          whole[at] = static_cast<char>(whole[at] ^ (1 << random() % 8));
          break;
      }
      if (whole.empty()) whole.push_back('x');
    }
    auto frames = frames_of(sample(Kind::advance), random() % 8);
    frames[0] = frame(whole);
    try {
      const auto message = decode(frames);
      encode_header(message);
      ++messages;
    } catch (const ProtocolError&) {
      ++errors;
    }
  }
  EXPECT_EQ(messages + errors, 20000);
  EXPECT_GT(messages, 0);
  EXPECT_GT(errors, 0);
}

TEST(Codec, NoiseEndsInAnError) {
  std::mt19937 random(20140);
  for (int round = 0; round < 20000; ++round) {
    std::string noise(random() % 200, '\0');
    for (auto& byte : noise) byte = static_cast<char>(random());
    EXPECT_THROW(decode(std::vector{frame(noise)}), ProtocolError);
  }
}

}  // namespace
}  // namespace acopla::protocol
