// libFuzzer target: any bytes at all, cut into frames, must end in a message or a ProtocolError.
// ./acopla fuzz SECONDS builds it with clang's sanitizers and runs it.
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <vector>

#include "protocol/codec.h"
#include "protocol/exchange.h"

namespace {

using namespace acopla::protocol;

Frame frame_of(const std::uint8_t* data, std::size_t size) {
  const std::shared_ptr<std::byte[]> copy(
      new std::byte[size]);  // its own block, so that a sanitizer sees every overrun
  if (size) std::memcpy(copy.get(), data, size);
  return {copy, copy.get(), size};
}

// A length in two bytes before each frame; the rest is the last one.
std::vector<Frame> cut(const std::uint8_t* data, std::size_t size) {
  std::vector<Frame> frames;
  while (size > 2) {
    const std::size_t length = std::min<std::size_t>(data[0] | (data[1] << 8), size - 2);
    frames.push_back(frame_of(data + 2, length));
    data += 2 + length;
    size -= 2 + length;
  }
  return frames;
}

// Uses that name every array, so that each is read.
std::vector<Run::Use> uses_of(const Message& message) {
  std::vector<Run::Use> uses;
  for (const auto& array : message.arrays) uses.push_back({array.mesh(), {array.name()}, {}});
  return uses;
}

void read_body(const Message& message) {
  switch (message.kind) {
    case Kind::hello:
      read_hello(message);
      break;
    case Kind::welcome:
      read_welcome(message);
      break;
    case Kind::interface:
      read_interface(message);
      break;
    case Kind::advance:
      read_advance(message, uses_of(message));
      break;
    case Kind::advanced:
      read_advanced(message);
      break;
    default:
      read_error(message);
      break;
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const auto memory = SharedMemory::create(0);
  try {
    const auto message = decode(cut(data, size), {}, memory.get());
    encode_header(message);
    read_body(message);
  } catch (const ProtocolError&) {
  }
  return 0;
}
