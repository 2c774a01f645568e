// Arrays in memory that two processes share.
#include <fcntl.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstring>
#include <limits>

#include "frames.h"
#include "protocol/channel.h"
#include "protocol/hub.h"

namespace acopla::protocol {
namespace {

constexpr std::uint64_t token = 0x1234567890abcdef;

TEST(SharedMemory, ShowsAnotherProcessWhatIsWrittenAndGrows) {
  const auto ours = SharedMemory::create(token);
  ASSERT_TRUE(ours);
  const auto child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    const auto theirs = SharedMemory::open(ours->path(), token);
    if (!theirs) ::_exit(2);
    std::memset(theirs->room(1 << 20), 'x', 1 << 20);
    ::_exit(0);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_EQ(status, 0);
  const auto contents = ours->contents(SharedMemory::arrays_begin + (1 << 20));
  ASSERT_GE(contents.size(), SharedMemory::arrays_begin + (1 << 20));
  EXPECT_EQ(contents[SharedMemory::arrays_begin + (1 << 20) - 1], std::byte{'x'});
  EXPECT_EQ(std::memcmp(contents.data(), &token, sizeof token), 0);
}

TEST(SharedMemory, APathThatMeansSomethingElseHereIsNotTaken) {
  const auto memory = SharedMemory::create(token);
  EXPECT_FALSE(SharedMemory::open(memory->path(), token + 1));
  EXPECT_FALSE(SharedMemory::open("/proc/1/fd/999", token));
  char name[] = "/tmp/acopla-memory-XXXXXX";
  const int file = ::mkstemp(name);  // may shrink under a reader
  ASSERT_GE(file, 0);
  ASSERT_EQ(::write(file, &token, sizeof token), static_cast<ssize_t>(sizeof token));
  ASSERT_EQ(::ftruncate(file, 1 << 16), 0);
  EXPECT_FALSE(SharedMemory::open(name, token));
  ::close(file);
  ::unlink(name);
  int pipe_ends[2];
  ASSERT_EQ(::pipe(pipe_ends), 0);
  EXPECT_FALSE(SharedMemory::open(fmt::format("/proc/{}/fd/{}", ::getpid(), pipe_ends[0]), token));
  for (const int end : pipe_ends) ::close(end);
}

TEST(SharedMemory, CannotBeCutUnderAReader) {
  const auto memory = SharedMemory::create(token);
  ASSERT_TRUE(memory->room(1 << 16));
  EXPECT_NE(::truncate(memory->path().c_str(), 0), 0);
}

TEST(SharedMemory, AMessageLongerThanTheMostIsRefused) {
  const auto memory = SharedMemory::create(token);
  EXPECT_EQ(memory->room(SharedMemory::most + 1), nullptr);
  EXPECT_EQ(memory->room(std::numeric_limits<std::size_t>::max()), nullptr);
  EXPECT_NE(memory->room(100), nullptr);
}

Message message_with(std::vector<double> values) {
  Message message;
  message.kind = Kind::advance;
  const std::uint64_t count = values.size();
  message.arrays.push_back(Array::of("force", "box", {count}, std::move(values)));
  return message;
}

TEST(SharedMemory, ArraysAreReadWhereTheHeaderSaysAndNowhereElse) {
  const auto memory = SharedMemory::create(token);
  const auto message = message_with({1, 2, 3});
  auto* room = memory->room(4000);
  std::memcpy(room + 8, message.arrays[0].bytes().data(), 24);
  const auto read = [&](std::uint64_t offset, SharedMemory* agreed) {
    return decode(std::vector{frame(encode_header(message, std::vector{offset}))}, {}, agreed);
  };
  const auto begin = SharedMemory::arrays_begin;
  EXPECT_EQ(read(begin + 8, memory.get()).arrays[0].doubles()[2], 3);
  EXPECT_EQ(read(begin + 8, memory.get()).arrays[0].bytes().data(), memory->contents(begin).data() + begin + 8) << "in place";
  std::memcpy(room + 1, message.arrays[0].bytes().data(), 24);
  EXPECT_EQ(read(begin + 1, memory.get()).arrays[0].doubles()[1], 2) << "a copy where it is not aligned";
  EXPECT_THROW(read(begin + 8, nullptr), ProtocolError);
  for (const std::uint64_t outside : {std::uint64_t{0}, begin - 1, std::uint64_t{4096 - 23}, std::uint64_t{1} << 40, std::numeric_limits<std::uint64_t>::max() - 7})
    EXPECT_THROW(read(outside, memory.get()), ProtocolError) << outside;
  EXPECT_NO_THROW(read(4096 - 24, memory.get()));
  // A frame beside an array that lies in memory belongs to nothing.
  EXPECT_THROW(decode(std::vector{frame(encode_header(message, std::vector{begin + 8})), frame("surplus")}, {}, memory.get()), ProtocolError);
}

// The reader's view of the memory moves when it grows: all arrays of a message must lie in the same one.
TEST(SharedMemory, SeveralArraysOfAMemoryThatGrewAreReadFromOnePlace) {
  const auto ours = SharedMemory::create(token);
  const auto theirs = SharedMemory::open(ours->path(), token);
  ASSERT_TRUE(theirs);
  for (std::size_t count = 100; count <= 1'000'000; count *= 10) {
    auto message = message_with(std::vector<double>(count, 1));
    message.arrays.push_back(message_with(std::vector<double>(count, 2)).arrays[0]);
    const std::vector<std::uint64_t> at{SharedMemory::arrays_begin, SharedMemory::arrays_begin + 8 * count};
    auto* room = ours->room(16 * count);
    ASSERT_TRUE(room);
    for (std::size_t k = 0; k < 2; ++k) std::memcpy(room + 8 * count * k, message.arrays[k].bytes().data(), 8 * count);
    const auto read = decode(std::vector{frame(encode_header(message, at))}, {}, theirs.get());
    EXPECT_EQ(read.arrays[0].doubles()[count - 1], 1);
    EXPECT_EQ(read.arrays[1].doubles()[count - 1], 2);
  }
}

TEST(SharedMemory, LongArraysOfAConnectionGoThroughItOnceItIsFound) {
  zmq::context_t context;
  const auto endpoint = fmt::format("ipc:///tmp/acopla-memory-{}", ::getpid());
  Hub hub(context, endpoint);
  zmq::socket_t solver(context, zmq::socket_type::dealer);
  solver.connect(endpoint);
  ASSERT_TRUE(send(solver, Message{}));
  const auto peer = hub.receive(std::chrono::seconds(5))->peer;
  const auto offer = hub.offer_memory(peer);
  ASSERT_TRUE(offer);
  auto memory = MemoryPair::open(*offer);
  ASSERT_TRUE(memory.is_there());

  const auto frames = [&](const Message& message) {
    EXPECT_TRUE(hub.send(peer, message));
    return receive_parcel(solver, std::chrono::seconds(5), false)->frames;
  };
  const auto few = message_with({1, 2, 3}), many = message_with(std::vector<double>(100'000, 4));
  EXPECT_EQ(frames(many).size(), 2u) << "not found yet";
  hub.use_memory(peer);
  EXPECT_EQ(frames(few).size(), 2u) << "as fast as it is";
  for (int turn = 0; turn < 3; ++turn) {
    const auto alone = frames(many);
    ASSERT_EQ(alone.size(), 1u);
    EXPECT_EQ(decode(alone, {}, memory.requests.get()).arrays[0].doubles()[99'999], 4);
  }
  ASSERT_TRUE(send(solver, many, {}, memory.answers.get()));
  const auto arrival = hub.receive(std::chrono::seconds(5));
  ASSERT_TRUE(arrival && arrival->message) << arrival->fault;
  EXPECT_EQ(arrival->message->arrays[0].doubles()[0], 4);
}

TEST(SharedMemory, IsOfferedOnOneMachineOnly) {
  zmq::context_t context;
  EXPECT_FALSE(Hub(context, "tcp://127.0.0.1:*").offer_memory("peer"));
  EXPECT_FALSE(Hub(context, "inproc://memory").offer_memory("peer")) << "bytes are shared there anyway";
}

}  // namespace
}  // namespace acopla::protocol
