// Memory through which two processes of one machine hand each other long arrays (docs/protocol.md, §8).
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "protocol/message.h"

namespace acopla::protocol {

/// A file without a name that lies in memory: one side writes, the other reads what messages point at. The system takes it back when both
/// processes are gone, however they ended.
class SharedMemory {
 public:
  /// Where a message's arrays begin; a token lies before them, so that a path that means another file elsewhere is found out [bytes].
  static constexpr std::uint64_t arrays_begin = 64;

  /// @return nullptr where the system has none to give
  static std::unique_ptr<SharedMemory> create(std::uint64_t token);
  /// What another process created. @return nullptr when it cannot be seen from here: another machine, user or container
  static std::unique_ptr<SharedMemory> open(const std::string& path, std::uint64_t token);
  ~SharedMemory();
  SharedMemory(const SharedMemory&) = delete;
  SharedMemory& operator=(const SharedMemory&) = delete;

  const std::string& path() const { return path_; }  ///< for open() in another process
  /// The longest message [bytes]. More travels in frames: the system would look for so much memory until others have none.
  static constexpr std::size_t most = std::size_t{1} << 30;

  /// `bytes` that may be written, from `arrays_begin` on; nullptr for more than `most`, or than the system has. What lay there is overwritten.
  std::byte* room(std::size_t bytes);
  /// So many of its bytes or more, as the other side has written them, or all where there are fewer; in place until the next call.
  /// @throws ProtocolError when they cannot be mapped
  std::span<const std::byte> contents(std::uint64_t bytes);

 private:
  explicit SharedMemory(int descriptor) : descriptor_(descriptor) {}
  bool map(std::size_t bytes);

  int descriptor_;
  std::string path_;
  std::byte* memory_ = nullptr;
  std::size_t mapped_ = 0;
};

/// How a participant finds the two memories of its connection.
struct MemoryOffer {
  std::string requests, answers;  ///< paths
  std::uint64_t token = 0;        ///< of both
};

/// One memory for each direction. Requests and answers take turns, so that each message may lie where the last one lay.
struct MemoryPair {
  std::unique_ptr<SharedMemory> requests, answers;
  std::uint64_t token = 0;

  static MemoryPair create();
  static MemoryPair open(const MemoryOffer& offer);
  /// Both or none.
  bool is_there() const { return requests && answers; }
  MemoryOffer offer() const { return {requests->path(), answers->path(), token}; }
};

}  // namespace acopla::protocol
