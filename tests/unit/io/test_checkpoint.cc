// States and checkpoints: every bit comes back, in memory and from a file, and what is not whole is refused. Nothing here has a
// tolerance, since saving does no arithmetic: bits are compared.
#include "io/checkpoint.h"

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <Eigen/Core>
#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <functional>
#include <limits>
#include <optional>
#include <random>
#include <stdexcept>

#include "tests/unit/io/scratch.h"

namespace acopla::io {
namespace {

struct alignas(32) Quad {
  double x, y, z, w;
};
struct alignas(32) Named {  // the same, but files show four numbers
  double x, y, z, w;
};
struct Mixed {
  std::uint32_t id, kind;
  double value;
};
enum class Phase : std::uint8_t { rest, stick = 7, slide = 200 };

}  // namespace

template <>
inline constexpr Element element_of<Named> = {Element::Kind::real, 8, 4};

namespace {

struct Clock {
  std::int64_t ticks = 0;
  double phase = 0;
  template <class Archive>
  void state(Archive& a) {
    a("ticks", ticks);
    a("phase", phase);
  }
};

class Wall {
 public:
  Wall() = default;
  explicit Wall(double at) : clock{3, at}, history(2, at) {}
  template <class Archive>
  void state(Archive& a) {
    a("clock", clock);
    a("history", history);
    if constexpr (Archive::reading) ++restored;
  }
  Clock clock;
  std::vector<double> history;
  int restored = 0;
};

// One member of every type that can be saved, called in `members` with its name.
struct Everything {
  bool yes{}, no{};
  char letter{};
  std::int8_t i8{};
  std::uint16_t u16{};
  std::int32_t i32{};
  std::uint64_t u64{};
  float single{};
  double real{};
  Phase phase{};
  std::string text, empty_text;
  Eigen::Vector3d vector = Eigen::Vector3d::Zero();
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();
  std::array<double, 3> array{};
  std::array<std::string, 2> texts{};
  Quad quad{};
  std::pair<std::int32_t, std::string> pair;
  std::vector<double> reals;
  std::vector<std::uint8_t> bytes;
  std::vector<Phase> phases;
  std::vector<bool> bits;
  std::vector<Quad> quads;
  std::vector<Named> named;
  std::vector<Mixed> mixed;
  std::vector<Eigen::Vector3d> vectors;
  std::vector<std::array<double, 2>> arrays;
  std::vector<std::pair<std::uint32_t, double>> pairs;
  std::vector<std::pair<std::string, bool>> settings;
  std::vector<std::string> words;
  std::vector<std::vector<std::uint32_t>> rows;
  std::vector<std::vector<Eigen::Vector3d>> vector_rows;
  std::vector<std::vector<std::vector<float>>> deep;
  std::vector<std::vector<bool>> bit_rows;
  std::array<std::vector<double>, 2> both;
  Clock clock;
  std::vector<Wall> walls;
  std::mt19937_64 random;

  template <class Visit>
  void members(Visit&& a) {
    a("yes", yes), a("no", no), a("letter", letter), a("i8", i8), a("u16", u16), a("i32", i32), a("u64", u64);
    a("single", single), a("real", real), a("phase", phase), a("text", text), a("empty_text", empty_text);
    a("vector", vector), a("matrix", matrix), a("array", array), a("texts", texts), a("quad", quad), a("pair", pair);
    a("reals", reals), a("bytes", bytes), a("phases", phases), a("bits", bits), a("quads", quads), a("named", named);
    a("mixed", mixed), a("vectors", vectors), a("arrays", arrays), a("pairs", pairs), a("settings", settings);
    a("words", words), a("rows", rows), a("vector_rows", vector_rows), a("deep", deep), a("bit_rows", bit_rows);
    a("both", both), a("clock", clock), a("walls", walls), a("random", random);
  }
  template <class Archive>
  void state(Archive& a) {
    members(a);
  }
};

// Writes any value into a string of bits, by rules of its own and not by those of the archive.
struct Bits {
  std::string out;
  template <class T>
  void operator()(std::string_view, const T& value) {
    add(value);
  }
  template <class T>
  void add(const T& value) {
    if constexpr (std::is_same_v<T, Wall>) {
      add(value.clock), add(value.history);
    } else if constexpr (requires { value.first; }) {
      add(value.first), add(value.second);
    } else if constexpr (requires { value.rows(); }) {
      out.append(reinterpret_cast<const char*>(value.data()), static_cast<std::size_t>(value.size()) * sizeof(double));
    } else if constexpr (requires { value.begin(); }) {
      out += std::to_string(value.size()) + ":";
      for (const auto& each : value) {
        if constexpr (std::is_same_v<T, std::vector<bool>>)
          out += each ? '1' : '0';
        else
          add(each);
      }
    } else {
      out.append(reinterpret_cast<const char*>(&value), sizeof(value));
    }
  }
};

std::string bits_of(Everything& value) {
  Bits bits;
  value.members(bits);
  return bits.out;
}

// Random bits: of eight doubles one is not a number with a payload, quiet or signalling, one is −0 and one denormal.
class Draw {
 public:
  explicit Draw(std::uint64_t seed) : random_(seed) {}
  std::uint64_t word() { return random_(); }
  std::size_t size() { return word() % 6; }
  double real() {
    const auto bits = word();
    switch (bits % 8) {
      case 0:
        return std::bit_cast<double>(0x7ff0000000000000u | (bits >> 12) | 1u | (bits << 63));
      case 1:
        return -0.0;
      case 2:
        return std::bit_cast<double>(bits >> 12);
      default:
        return std::bit_cast<double>(bits);
    }
  }
  std::string text() {
    std::string value(size() * 7, '\0');  // with zeros inside and at the end
    for (auto& c : value) c = static_cast<char>(word() % 3);
    return value;
  }
  template <class Make>
  auto list(Make make) {
    std::vector<std::decay_t<decltype(make())>> values;
    for (auto n = size(); n > 0; --n) values.push_back(make());
    return values;
  }
  Eigen::Vector3d vector() { return Eigen::Vector3d(real(), real(), real()); }
  bool bit() { return word() % 2; }

 private:
  std::mt19937_64 random_;
};

Everything anything(std::uint64_t seed) {
  Draw d(seed);
  Everything e;
  e.yes = true;
  e.letter = static_cast<char>(d.word());
  e.i8 = static_cast<std::int8_t>(d.word());
  e.u16 = static_cast<std::uint16_t>(d.word());
  e.i32 = static_cast<std::int32_t>(d.word());
  e.u64 = d.word();
  e.single = std::bit_cast<float>(static_cast<std::uint32_t>(d.word()));
  e.real = d.real();
  e.phase = d.bit() ? Phase::slide : Phase::stick;
  e.text = d.text();
  e.vector = d.vector();
  for (int k = 0; k < 9; ++k) e.matrix(k) = d.real();
  e.array = {d.real(), d.real(), d.real()};
  e.texts = {d.text(), d.text()};
  e.quad = {d.real(), d.real(), d.real(), d.real()};
  e.pair = {static_cast<std::int32_t>(d.word()), d.text()};
  const auto real = [&] { return d.real(); };
  const auto vector = [&] { return d.vector(); };
  const auto integer = [&] { return static_cast<std::uint32_t>(d.word()); };
  e.reals = d.list(real);
  e.bytes = d.list([&] { return static_cast<std::uint8_t>(d.word()); });
  e.phases = d.list([&] { return d.bit() ? Phase::rest : Phase::slide; });
  e.bits = d.list([&] { return d.bit(); });
  e.quads = d.list([&] { return Quad{d.real(), d.real(), d.real(), d.real()}; });
  e.named = d.list([&] { return Named{d.real(), d.real(), d.real(), d.real()}; });
  e.mixed = d.list([&] { return Mixed{integer(), integer(), d.real()}; });
  e.vectors = d.list(vector);
  e.arrays = d.list([&] { return std::array{d.real(), d.real()}; });
  e.pairs = d.list([&] { return std::pair{integer(), d.real()}; });
  e.settings = d.list([&] { return std::pair{d.text(), d.bit()}; });
  e.words = d.list([&] { return d.text(); });
  e.rows = d.list([&] { return d.list(integer); });
  e.vector_rows = d.list([&] { return d.list(vector); });
  e.deep = d.list([&] { return d.list([&] { return d.list([&] { return static_cast<float>(integer()); }); }); });
  e.bit_rows = d.list([&] { return d.list([&] { return d.bit(); }); });
  e.both = {d.list(real), d.list(real)};
  e.clock = {static_cast<std::int64_t>(d.word()), d.real()};
  e.walls = d.list([&] { return Wall(d.real()); });
  e.random.seed(seed);
  return e;
}

const CheckpointInfo origin{"acopla-dem 0.1.0", "grains", 0.1, 12345678901234, "9f86d081884c7d65"};

using SavedState = Scratch;
using Checkpoint = Scratch;

TEST_F(SavedState, EveryBitOfEveryTypeComesBackWhateverTheObjectHeldBefore) {
  State state;
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    auto saved = anything(seed), restored = anything(seed + 1000);
    ASSERT_NE(bits_of(saved), bits_of(restored));
    save(saved, state);
    restore(state, restored);
    ASSERT_EQ(bits_of(saved), bits_of(restored)) << seed;
    State again;
    save(restored, again);
    EXPECT_EQ(state, again);
    for (const auto& wall : restored.walls) EXPECT_GE(wall.restored, 1);
    for (const auto& wall : saved.walls) EXPECT_EQ(wall.restored, 0);
  }
}

TEST_F(SavedState, StatesDifferWhereOneBitDoes) {
  const double zero = 0;
  double nan = std::numeric_limits<double>::quiet_NaN();
  const auto saved = [](const double& value) {
    State state;
    StateWriter{state}("x", value);
    return state;
  };
  EXPECT_EQ(saved(nan), saved(nan));
  EXPECT_NE(saved(zero), saved(-zero));
  EXPECT_NE(saved(nan), saved(std::bit_cast<double>(std::bit_cast<std::uint64_t>(nan) ^ 1)));
}

// A mass on a spring with dry friction and random knocks: its future hangs on every member.
struct Oscillator {
  double position = 1, velocity = 0;
  bool slides = true;
  std::mt19937_64 knocks{7};
  std::vector<double> path;
  template <class Archive>
  void state(Archive& a) {
    a("position", position);
    a("velocity", velocity);
    a("slides", slides);
    a("knocks", knocks);
    a("path", path);
  }
  void advance(int steps) {
    for (int k = 0; k < steps; ++k) {
      slides = std::abs(position) > 0.1 || std::abs(velocity) > 0.01;
      const double knock = 0.1 * (static_cast<double>(knocks() >> 11) * 0x1p-53 - 0.5);
      velocity += 0.01 * (-40 * position - (slides ? std::copysign(0.5, velocity) : 0.0) + knock);
      position += 0.01 * velocity;
      path.push_back(position);
    }
  }
};

TEST_F(Checkpoint, ARepeatedWindowAndARestartFollowTheSameTrajectory) {
  Oscillator whole;
  whole.advance(123);
  State before, after, now;
  save(whole, before);
  write_checkpoint(path("half.h5"), before, origin);
  whole.advance(456);
  save(whole, after);

  restore(before, whole);
  whole.advance(456);
  save(whole, now);
  EXPECT_EQ(now, after);

  Oscillator resumed;
  restore(read_checkpoint(path("half.h5")).first, resumed);
  resumed.advance(456);
  save(resumed, now);
  EXPECT_EQ(now, after);
}

TEST_F(SavedState, MemoryIsReusedFromSaveToSave) {
  auto object = anything(3);
  object.quads.resize(1000);
  State state;
  save(object, state);
  const auto capacity = state.capacity();
  const auto* const memory = state.entry(0).bytes.data();
  object.quads.resize(900);  // a smaller state too
  save(object, state);
  object.quads.resize(1000);
  save(object, state);
  EXPECT_EQ(state.capacity(), capacity);
  EXPECT_EQ(state.entry(0).bytes.data(), memory);

  State moved = std::move(state);
  EXPECT_EQ(moved.entry(0).bytes.data(), memory);
  EXPECT_TRUE(state.empty());  // NOLINT(bugprone-use-after-move): promised
  state = moved;
  EXPECT_EQ(state, moved);
}

TEST_F(SavedState, ArraysHaveDottedNamesAndTypes) {
  State state;
  auto object = anything(1);
  object.walls = {Wall(1), Wall(2)};
  save(object, state);
  std::vector<std::string> found;
  for (std::size_t at = 0; at < state.bytes(); at = state.entry(at).next) {
    const auto entry = state.entry(at);
    found.push_back(std::string(entry.name) + ": " + entry.element.text());
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(entry.bytes.data()) % 64, 0u);  // on a cache line
  }
  for (const auto* wanted : {"yes: bool",
                             "letter: int8",
                             "u16: uint16",
                             "single: float32",
                             "phase: uint8",
                             "text: text",
                             "vector: float64[3]",
                             "matrix: float64[9]",
                             "array: float64[3]",
                             "texts[1]: text",
                             "quads: record of 32 bytes",
                             "named: float64[4]",
                             "arrays: float64[2]",
                             "pairs.first: uint32",
                             "pairs.second: float64",
                             "rows.sizes: uint64",
                             "rows: uint32",
                             "bits: bool",
                             "clock.phase: float64",
                             "walls.size: uint64",
                             "walls[1].clock.ticks: int64",
                             "walls[1].history: float64"})
    EXPECT_EQ(std::count(found.begin(), found.end(), wanted), 1) << wanted;
}

struct Fixed {
  explicit Fixed(double given) : value(given) {}
  double value;
  template <class Archive>
  void state(Archive& a) {
    a("value", value);
  }
};

TEST_F(SavedState, SpansAndObjectsThatCannotBeMadeKeepTheirNumber) {
  std::vector<Fixed> walls{Fixed(1), Fixed(2)};
  std::vector<double> outside{1, 2, 3};
  State state;
  StateWriter writer(state);
  writer("outside", std::span(outside));
  writer("walls", walls);

  std::vector<Fixed> into{Fixed(0), Fixed(0)};
  std::vector<double> memory(3);
  StateReader reader(state);
  reader("outside", std::span(memory));
  reader("walls", into);
  reader.finish();
  EXPECT_EQ(memory, outside);
  EXPECT_EQ(into[1].value, 2);

  memory.resize(2);
  expect_mistake([&] { StateReader{state}("outside", std::span(memory)); },
                 "\"outside\" was saved with size 3 and should have size 2");
  into.emplace_back(0);
  memory.resize(3);
  StateReader second(state);
  second("outside", std::span(memory));
  expect_mistake([&] { second("walls", into); }, "\"walls\" was saved with size 2 and should have size 3");
}

TEST_F(SavedState, AnotherDescriptionIsRefusedWithASentence) {
  State state;
  StateWriter writer(state);
  writer("position", 1.0);
  writer("wall", Wall(0.5));
  const auto refused = [&](const std::function<void(StateReader&)>& read, const std::string& words) {
    expect_mistake(
        [&] {
          StateReader reader(state);
          read(reader);
          reader.finish();
        },
        words);
  };
  double real = 0;
  float single = 0;
  Clock clock;
  Wall wall;
  std::vector<double> reals;
  std::pair<int, int> pair;
  refused(
      [&](auto& a) { a("wall", wall); },
      "the saved state has \"position\" where \"wall.clock.ticks\" should be. It was saved by another version of the program or "
      "from another case: restore it with those, or start the run from its beginning.");
  refused([&](auto& a) { a("position", single); }, "\"position\" was saved as float64 and should be float32.");
  refused([&](auto& a) { a("position", pair); }, "has \"position\" where \"position.first\" should be");
  refused([&](auto& a) { a("position", real), a("wall", clock); }, "has \"wall.clock.ticks\" where \"wall.ticks\" should be");
  refused([&](auto& a) { a("position", real); }, "the saved state goes on with \"wall.clock.ticks\" where it should end");
  refused([&](auto& a) { a("position", real), a("wall", wall), a("more", reals); }, "ends where \"more\" should follow");

  // From a file the sentence begins with its name.
  write_checkpoint(path("a.h5"), state, origin);
  const auto read = read_checkpoint(path("a.h5")).first;
  expect_mistake([&] { StateReader{read}("wall", wall); }, path("a.h5") + ": the saved state has \"position\" where");
}

constexpr std::size_t particles = 21296, records = 7;

struct Bed {
  std::array<std::vector<Quad>, records> arrays;
  template <class Archive>
  void state(Archive& a) {
    a("arrays", arrays);
  }
};

TEST_F(SavedState, SavingABedCostsLittleMoreThanCopyingIt) {  // a report; only the bits are required
  Bed bed;
  for (auto& array : bed.arrays) array.resize(particles, Quad{1, 2, 3, 4});
  std::vector<Quad> copy(particles * records);
  State state;
  const auto fastest = [](const auto& act) {
    double best = std::numeric_limits<double>::infinity();
    for (int k = 0; k < 20; ++k) {
      const auto start = std::chrono::steady_clock::now();
      act();
      best = std::min(best, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
    }
    return best;
  };
  const auto copying = fastest([&] {
    for (std::size_t k = 0; k < records; ++k) std::copy(bed.arrays[k].begin(), bed.arrays[k].end(), copy.data() + k * particles);
  });
  const auto saving = fastest([&] { save(bed, state); });
  auto other = bed;
  const auto restoring = fastest([&] { restore(state, other); });
  EXPECT_EQ(std::memcmp(other.arrays[6].data(), bed.arrays[6].data(), particles * sizeof(Quad)), 0);
  const double gigabytes = static_cast<double>(particles * records * sizeof(Quad)) / 1e9;
  std::printf("copying %.2f GB/s, saving %.2f GB/s, restoring %.2f GB/s\n", gigabytes / copying, gigabytes / saving,
              gigabytes / restoring);
  RecordProperty("saving_over_copying", std::to_string(saving / copying));
}

TEST_F(Checkpoint, EveryBitOfEveryTypeComesBackFromAFile) {
  State state;
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    auto saved = anything(seed), restored = anything(seed + 1000);
    save(saved, state);
    write_checkpoint(path("a.h5"), state, origin);
    const auto [read, info] = read_checkpoint(path("a.h5"));
    EXPECT_EQ(read, state);
    EXPECT_EQ(info, origin);
    EXPECT_EQ(read.source(), path("a.h5"));
    restore(read, restored);
    ASSERT_EQ(bits_of(saved), bits_of(restored)) << seed;
  }
}

TEST_F(Checkpoint, NothingAtAllCanBeSaved) {
  write_checkpoint(path("a.h5"), State(), CheckpointInfo());
  const auto [read, info] = read_checkpoint(path("a.h5"));
  EXPECT_TRUE(read.empty());
  EXPECT_EQ(info, CheckpointInfo());
}

TEST_F(Checkpoint, TheSameStateMakesTheSameFileWhoseChecksumIsTheStandardOne) {
  State state;
  save(anything(5), state);
  write_checkpoint(path("a.h5"), state, origin);
  const auto bytes = read("a.h5");
  sleep(1);  // no time of writing inside
  write_checkpoint(path("b.h5"), state, origin);
  EXPECT_EQ(read("b.h5"), bytes);

  // CRC-32 of ISO 3309 and zlib, one bit at a time; 0xcbf43926 is its published check value.
  const auto crc32 = [](std::string_view text) {
    std::uint32_t crc = ~0u;
    for (const unsigned char c : text) {
      crc ^= c;
      for (int k = 0; k < 8; ++k) crc = (crc >> 1) ^ (crc & 1 ? 0xedb88320u : 0u);
    }
    return ~crc;
  };
  ASSERT_EQ(crc32("123456789"), 0xcbf43926u);
  std::array<char, 16> written{};
  std::snprintf(written.data(), written.size(), "%08x", crc32(std::string_view(bytes).substr(512)));
  EXPECT_EQ(bytes.substr(0, bytes.find("\nAn HDF5")), "Acopla checkpoint\nformat 1\nbyte order little\nbytes " +
                                                          std::to_string(bytes.size()) + "\ncrc32 " + written.data());
  EXPECT_EQ(bytes.substr(512, 8), "\x89HDF\r\n\x1a\n");
}

TEST_F(Checkpoint, AFileThatIsCutOffOrHasOneFlippedBitIsRefused) {
  State state;
  auto object = anything(5);
  object.quads.resize(3000);
  save(object, state);
  write_checkpoint(path("whole.h5"), state, origin);
  const auto whole = read("whole.h5");
  ASSERT_GT(whole.size(), 100000u);
  std::mt19937_64 random(1);
  for (std::size_t k = 0; k < 64; ++k) {
    const auto first = k * whole.size() / 64, next = (k + 1) * whole.size() / 64;
    expect_mistake([&] { read_checkpoint(write("cut.h5", whole.substr(0, first))); }, "cut off");
    auto bytes = whole;
    bytes[first + random() % (next - first)] ^= static_cast<char>(1 << random() % 8);
    expect_mistake([&] { read_checkpoint(write("flipped.h5", bytes)); }, path("flipped.h5") + ": th");
  }
  expect_mistake([&] { read_checkpoint(write("cut.h5", whole.substr(0, whole.size() - 1))); },
                 "and was written with " + std::to_string(whole.size()) + ": it is cut off or damaged. Resume from another");
  expect_mistake([&] { read_checkpoint(write("long.h5", whole + '\0')); }, "damaged");
  auto bytes = whole;
  bytes[whole.size() / 2] ^= 16;
  expect_mistake([&] { read_checkpoint(write("flipped.h5", bytes)); },
                 "is damaged: its checksum does not match. Resume from another");
}

TEST_F(Checkpoint, EveryFlippedBitOfTheHeadingIsRefused) {
  write_checkpoint(path("whole.h5"), State(), origin);
  std::fstream file(path("whole.h5"), std::ios::in | std::ios::out | std::ios::binary);
  const auto flip = [&](int bit) {
    file.seekg(bit / 8);
    const int byte = file.peek();
    file.seekp(bit / 8);
    file.put(static_cast<char>(byte ^ (1 << bit % 8))).flush();
  };
  for (int bit = 0; bit < 8 * 512; ++bit) {
    flip(bit);
    EXPECT_THROW(read_checkpoint(path("whole.h5")), UserError) << bit;
    flip(bit);
  }
  EXPECT_NO_THROW(read_checkpoint(path("whole.h5")));
}

TEST_F(Checkpoint, OtherFilesAreRefusedWithASentence) {
  State state;
  save(anything(5), state);
  write_checkpoint(path("a.h5"), state, origin);
  const auto whole = read("a.h5");
  const auto with = [&](const std::string& old, const std::string& put) {
    auto bytes = whole;
    bytes.replace(bytes.find(old), old.size(), put);
    bytes.erase(500, put.size() - old.size());
    return write("other.h5", bytes);
  };
  expect_mistake([&] { read_checkpoint(with("format 1", "format 12")); },
                 "is of format 12; this program reads format 1. Resume it with the version of Acopla that wrote it");
  expect_mistake([&] { read_checkpoint(with("order little", "order bigger")); },
                 "is of byte order bigger and this machine's is little. Resume it on a machine like the one");
  expect_mistake([&] { read_checkpoint(write("text.h5", "not a checkpoint")); },
                 "this is not a checkpoint of Acopla. Name a file");
  expect_mistake([&] { read_checkpoint(write("hdf5.h5", whole.substr(512))); }, "this is not a checkpoint of Acopla");
  expect_mistake([&] { read_checkpoint(write("empty.h5", "")); }, "cut off after 0 bytes");
  expect_mistake([&] { read_checkpoint(path("none.h5")); }, "there is no such checkpoint. Check the path");
  expect_mistake([&] { write_checkpoint(path("no/such/a.h5"), state, origin); }, "cannot be written");
}

TEST_F(Checkpoint, AnotherOriginIsRefusedWithASentence) {
  auto wanted = origin;
  check_origin("a.h5", origin, wanted);
  wanted.time = 7;  // where the run stands is no part of its origin
  wanted.ticks = 7;
  check_origin("a.h5", origin, wanted);
  wanted.case_hash = "";  // not asked
  check_origin("a.h5", origin, wanted);
  wanted.case_hash = "feed";
  expect_mistake(
      [&] { check_origin("a.h5", origin, wanted); },
      "a.h5: the checkpoint was written for a case whose hash is 9f86d081884c7d65; that of this case is feed. Resume with");
  wanted.program_version = "acopla-dem 0.2.0";
  expect_mistake([&] { check_origin("a.h5", origin, wanted); },
                 "was written by acopla-dem 0.1.0 and this is acopla-dem 0.2.0. Resume");
  wanted.participant = "box";
  expect_mistake([&] { check_origin("a.h5", origin, wanted); }, "of the participant \"grains\", not of \"box\". Give each");
}

TEST_F(Checkpoint, NamesThatCannotBeToldApartAreAMistakeOfTheProgram) {
  for (const auto* const name : {"twice", "a/b", ""}) {
    State state;
    StateWriter writer(state);
    writer("twice", 1);
    writer(name, 2);
    EXPECT_THROW(write_checkpoint(path("a.h5"), state, origin), std::logic_error) << name;
    EXPECT_TRUE(std::filesystem::is_empty(folder_)) << name;
  }
}

// A state that tells whether it is all of one writing.
State marked(std::int64_t mark) {
  State state;
  StateWriter writer(state);
  writer("marks", std::vector<std::int64_t>(50000, mark));
  return state;
}

std::optional<std::int64_t> mark_of(const std::string& path) {
  const auto [state, info] = read_checkpoint(path);
  return state == marked(info.ticks) ? std::optional(info.ticks) : std::nullopt;
}

TEST_F(Checkpoint, ARunThatIsKilledWhileWritingLeavesAWholeCheckpoint) {
  const auto file = path("a.h5");
  write_checkpoint(file, marked(0), {"", "", 0, 0, ""});
  int unfinished = 0;
  for (int k = 0; k < 30; ++k) {
    const pid_t child = fork();
    if (child == 0) {
      for (std::int64_t mark = 1;; ++mark) write_checkpoint(file, marked(mark), {"", "", 0, mark, ""});
    }
    usleep(static_cast<useconds_t>(2000 + 700 * k));
    kill(child, SIGKILL);
    waitpid(child, nullptr, 0);
    EXPECT_TRUE(mark_of(file).has_value());
    unfinished += std::filesystem::exists(file + ".part");
  }
  EXPECT_GT(unfinished, 0) << "no kill fell into a writing, so that nothing was tested";
}

TEST_F(Checkpoint, AnUnfinishedFileDoesNotDisturb) {
  write_checkpoint(path("a.h5"), marked(1), {"", "", 0, 1, ""});
  write("a.h5.part", read("a.h5").substr(0, 1000));
  EXPECT_EQ(mark_of(path("a.h5")), 1);
  write_checkpoint(path("a.h5"), marked(2), {"", "", 0, 2, ""});
  EXPECT_EQ(mark_of(path("a.h5")), 2);
  EXPECT_FALSE(std::filesystem::exists(path("a.h5.part")));
}

TEST_F(Checkpoint, AFullDiskLeavesThePreviousCheckpointAndTheNextOneIsWritten) {
  const auto file = path("a.h5");
  write_checkpoint(file, marked(1), {"", "", 0, 1, ""});
  const pid_t child = fork();
  if (child == 0) {
    signal(SIGXFSZ, SIG_IGN);  // writing beyond the limit fails, as on a full disk
    rlimit limit{};
    getrlimit(RLIMIT_FSIZE, &limit);
    bool right = true;
    for (const rlim_t allowed : {100, 1000, 3000, 100000, 400000, 401000}) {
      const rlimit low{allowed, limit.rlim_max};
      setrlimit(RLIMIT_FSIZE, &low);
      try {
        write_checkpoint(file, marked(2), {"", "", 0, 2, ""});
        right = false;
      } catch (const UserError& error) {
        right = right && std::string(error.what()).find("cannot be written") != std::string::npos;
      }
      right = right && mark_of(file) == 1 && !std::filesystem::exists(file + ".part");
    }
    setrlimit(RLIMIT_FSIZE, &limit);
    write_checkpoint(file, marked(3), {"", "", 0, 3, ""});
    _exit(right && mark_of(file) == 3 ? 0 : 1);
  }
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

}  // namespace
}  // namespace acopla::io
