// Reads messages from the standard input, decodes and encodes them, and writes them back: what codecs in other languages are tested against.
// A message is a count of frames (32 bits, little-endian), then each frame's length and bytes. The answer to what is no message is a count
// of zero and the reason, as a length and text.
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "protocol/codec.h"

namespace {

using namespace acopla::protocol;

bool read_count(std::uint32_t& count) { return std::fread(&count, sizeof count, 1, stdin) == 1; }

bool read_frames(std::vector<Frame>& frames) {
  std::uint32_t count = 0;
  if (!read_count(count)) return false;
  for (std::uint32_t k = 0; k < count; ++k) {
    std::uint32_t size = 0;
    if (!read_count(size)) return false;
    const std::shared_ptr<std::byte[]> bytes(new std::byte[size]);
    if (std::fread(bytes.get(), 1, size, stdin) != size) return false;
    frames.push_back({bytes, bytes.get(), size});
  }
  return true;
}

void write_count(std::size_t count) {
  const auto value = static_cast<std::uint32_t>(count);
  std::fwrite(&value, sizeof value, 1, stdout);
}

void write_bytes(const void* data, std::size_t size) {
  write_count(size);
  std::fwrite(data, 1, size, stdout);
}

void echo(const std::vector<Frame>& frames) {
  try {
    const auto message = decode(frames);
    const auto header = encode_header(message);
    write_count(1 + message.arrays.size());
    write_bytes(header.data(), header.size());
    for (const auto& array : message.arrays) write_bytes(array.bytes().data(), array.bytes().size());
  } catch (const ProtocolError& error) {
    write_count(0);
    write_bytes(error.what(), std::strlen(error.what()));
  }
}

}  // namespace

int main() {
  std::vector<Frame> frames;
  while (read_frames(frames)) {
    echo(frames);
    std::fflush(stdout);
    frames.clear();
  }
}
