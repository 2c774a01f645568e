// Messages as bytes: one MessagePack header, then one raw little-endian frame per array (docs/protocol.md, §2).
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "protocol/message.h"
#include "protocol/shared_memory.h"

namespace acopla::protocol {

/// What a decoder accepts; anything beyond is a ProtocolError, never a crash.
struct Limits {
  std::size_t header_bytes = 1 << 20;
  std::size_t depth = 16;            ///< nesting of the header
  std::size_t elements = 1 << 16;    ///< of one list or map of the header
  std::size_t arrays = 1024;
};

/// Bytes that someone keeps alive.
struct Frame {
  std::shared_ptr<const void> owner;
  const std::byte* data = nullptr;
  std::size_t size = 0;
  std::span<const std::byte> bytes() const { return {data, size}; }
};

/// The header frame of a message; the arrays' bytes follow it as they are.
/// @param offsets  where in shared memory each array lies instead; empty: none does
std::string encode_header(const Message& message, std::span<const std::uint64_t> offsets = {});

/// Reads a message back. Array bytes are used in place where they are aligned and copied where they are not.
/// @param frames  the header and one frame per array that does not lie in shared memory
/// @param memory  in which the sender may have laid arrays, which are read in place and overwritten by its next message; null: none was agreed on
/// @throws ProtocolError for anything that is not exactly one well-formed message
Message decode(std::span<const Frame> frames, const Limits& limits = {}, SharedMemory* memory = nullptr);

}  // namespace acopla::protocol
