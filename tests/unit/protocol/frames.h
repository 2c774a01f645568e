// Frames made by hand, for tests of the codec.
#pragma once

#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "protocol/codec.h"

namespace acopla::protocol {

/// A copy of the bytes, `offset` past an aligned address.
inline Frame frame(const std::string& bytes, std::size_t offset = 0) {
  const std::shared_ptr<std::byte[]> block(new std::byte[bytes.size() + offset + 16]);
  std::memcpy(block.get() + offset, bytes.data(), bytes.size());
  return {block, block.get() + offset, bytes.size()};
}

/// A message as it would arrive.
inline std::vector<Frame> frames_of(const Message& message, std::size_t offset = 0) {
  std::vector<Frame> frames{frame(encode_header(message))};
  for (const auto& array : message.arrays)
    frames.push_back(
        frame({reinterpret_cast<const char*>(array.bytes().data()), array.bytes().size()}, offset));
  return frames;
}

}  // namespace acopla::protocol
