#include "protocol/codec.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <msgpack.hpp>

namespace acopla::protocol {
namespace {

static_assert(std::endian::native == std::endian::little, "array frames are little-endian and sent as they lie in memory");

constexpr std::array all_kinds{Kind::hello,   Kind::welcome,    Kind::interface, Kind::advance, Kind::advanced,
                               Kind::save,    Kind::restore,    Kind::checkpoint, Kind::resume, Kind::finish,
                               Kind::done,    Kind::error,      Kind::ping,       Kind::pong};
constexpr std::array all_types{ArrayType::f8, ArrayType::i4, ArrayType::u1};

using Packer = msgpack::packer<msgpack::sbuffer>;

void pack_text(Packer& packer, std::string_view text) {
  packer.pack_str(static_cast<std::uint32_t>(text.size()));
  packer.pack_str_body(text.data(), static_cast<std::uint32_t>(text.size()));
}

void pack_value(Packer& packer, const Body& value) {
  switch (value.type()) {
    case Body::value_t::boolean: packer.pack(value.get<bool>()); break;
    case Body::value_t::number_integer: packer.pack(value.get<std::int64_t>()); break;
    case Body::value_t::number_unsigned: packer.pack(value.get<std::uint64_t>()); break;
    case Body::value_t::number_float: packer.pack(value.get<double>()); break;
    case Body::value_t::string: pack_text(packer, value.get_ref<const std::string&>()); break;
    case Body::value_t::array:
      packer.pack_array(static_cast<std::uint32_t>(value.size()));
      for (const auto& element : value) pack_value(packer, element);
      break;
    case Body::value_t::object:
      packer.pack_map(static_cast<std::uint32_t>(value.size()));
      for (const auto& [key, element] : value.items()) {
        pack_text(packer, key);
        pack_value(packer, element);
      }
      break;
    default: packer.pack_nil();
  }
}

// Text is UTF-8 (RFC 3629): no longer form than needed, no surrogates, nothing beyond U+10FFFF. What is not could be written into no summary.
bool is_utf8(std::string_view text) {
  for (std::size_t k = 0; k < text.size();) {
    const auto lead = static_cast<unsigned char>(text[k++]);
    if (lead < 0x80) continue;
    const int rest = lead >= 0xc2 && lead < 0xe0 ? 1 : lead >= 0xe0 && lead < 0xf0 ? 2 : lead >= 0xf0 && lead < 0xf5 ? 3 : 0;
    if (rest == 0) return false;
    for (int j = 0; j < rest; ++j, ++k) {
      if (k >= text.size()) return false;
      const auto next = static_cast<unsigned char>(text[k]);
      const bool first = j == 0;
      const unsigned char low = first && lead == 0xe0 ? 0xa0 : first && lead == 0xf0 ? 0x90 : 0x80;
      const unsigned char high = first && lead == 0xed ? 0x9f : first && lead == 0xf4 ? 0x8f : 0xbf;
      if (next < low || next > high) return false;
    }
  }
  return true;
}

std::string unpack_text(const msgpack::object_str& object) {
  std::string text(object.ptr, object.size);
  if (!is_utf8(text)) throw ProtocolError("the header holds text that is not UTF-8");
  return text;
}

Body unpack_value(const msgpack::object& object) {
  switch (object.type) {
    case msgpack::type::NIL: return nullptr;
    case msgpack::type::BOOLEAN: return object.via.boolean;
    case msgpack::type::POSITIVE_INTEGER: return object.via.u64;
    case msgpack::type::NEGATIVE_INTEGER: return object.via.i64;
    case msgpack::type::FLOAT32:
    case msgpack::type::FLOAT64: return object.via.f64;
    case msgpack::type::STR: return unpack_text(object.via.str);
    case msgpack::type::ARRAY: {
      Body list = Body::array();
      for (std::uint32_t k = 0; k < object.via.array.size; ++k) list.push_back(unpack_value(object.via.array.ptr[k]));
      return list;
    }
    case msgpack::type::MAP: {
      Body map = Body::object();
      for (std::uint32_t k = 0; k < object.via.map.size; ++k) {
        const auto& [key, value] = object.via.map.ptr[k];
        if (key.type != msgpack::type::STR) throw ProtocolError("a header map has a key that is not text");
        auto name = unpack_text(key.via.str);
        if (map.contains(name)) throw ProtocolError(fmt::format("the header names \"{}\" twice", name));
        map[std::move(name)] = unpack_value(value);
      }
      return map;
    }
    default: throw ProtocolError("the header holds a value of a type the protocol does not use");
  }
}

const Body& entry(const Body& map, const char* key, bool (Body::*is_type)() const noexcept, const char* type) {
  const auto found = map.find(key);
  if (found == map.end() || !((*found).*is_type)()) throw ProtocolError(fmt::format("the header has no {} \"{}\"", type, key));
  return *found;
}

template <class Enum, std::size_t N>
Enum named(const std::array<Enum, N>& all, const std::string& name, const char* what) {
  for (const auto value : all)
    if (name_of(value) == name) return value;
  throw ProtocolError(fmt::format("\"{}\" is not a {} of protocol version {}", name.substr(0, 40), what, version));
}

Body unpack_header(const Frame& frame, const Limits& limits) {
  if (frame.size > limits.header_bytes)
    throw ProtocolError(fmt::format("a header of {} bytes is over the limit of {}", frame.size, limits.header_bytes));
  try {
    std::size_t used = 0;
    const msgpack::unpack_limit bounds(limits.elements, limits.elements, limits.header_bytes, limits.header_bytes,
                                       limits.header_bytes, limits.depth);
    const auto handle =
        msgpack::unpack(reinterpret_cast<const char*>(frame.data), frame.size, used, nullptr, nullptr, bounds);
    if (used != frame.size) throw ProtocolError(fmt::format("{} bytes follow the header's end", frame.size - used));
    auto header = unpack_value(handle.get());
    if (!header.is_object()) throw ProtocolError("the header is not a map");
    return header;
  } catch (const msgpack::unpack_error& error) {
    throw ProtocolError(fmt::format("the header is not one MessagePack value within the limits ({})", error.what()));
  } catch (const std::bad_alloc&) {
    throw ProtocolError("the header asks for more memory than there is");
  }
}

/// What the header says of an array.
struct Entry {
  std::string name, mesh;
  ArrayType type = ArrayType::f8;
  std::vector<std::uint64_t> shape;
  std::uint64_t bytes = 0;
};

Entry read_entry(const Body& map) {
  if (!map.is_object()) throw ProtocolError("an array's entry in the header is not a map");
  Entry read;
  read.name = entry(map, "name", &Body::is_string, "text").get<std::string>();
  read.mesh = entry(map, "mesh", &Body::is_string, "text").get<std::string>();
  read.type = named(all_types, entry(map, "type", &Body::is_string, "text").get<std::string>(), "type");
  std::uint64_t without_zeros = read.bytes = bytes_of(read.type);
  const auto& extents = entry(map, "shape", &Body::is_array, "list");
  constexpr std::size_t most_extents = 32;  // what NumPy can hold
  if (extents.size() > most_extents) throw ProtocolError(fmt::format("array {} has an impossible shape", read.name));
  for (const auto& extent : extents) {
    if (!extent.is_number_unsigned()) throw ProtocolError(fmt::format("array {} has a shape that is not of counts", read.name));
    const auto count = extent.get<std::uint64_t>();
    read.shape.push_back(count);
    // Compared before use: a product that overflows or is larger than the frame never allocates anything.
    // Extents beside a zero too: readers in other languages multiply them before they see it.
    if (count != 0 && without_zeros > (std::uint64_t{1} << 48) / count)
      throw ProtocolError(fmt::format("array {} has an impossible shape", read.name));
    read.bytes *= count;
    if (count != 0) without_zeros *= count;
  }
  return read;
}

Array array_of(Entry read, const Frame& frame) {
  if (read.bytes != frame.size)
    throw ProtocolError(fmt::format("array {} on {} should have {} bytes by its shape, but has {}", read.name, read.mesh, read.bytes, frame.size));
  if (reinterpret_cast<std::uintptr_t>(frame.data) % bytes_of(read.type) == 0)
    return Array::view(std::move(read.name), std::move(read.mesh), read.type, std::move(read.shape), frame.owner, frame.data);
  const std::shared_ptr<std::byte[]> copy(new std::byte[frame.size]);
  std::memcpy(copy.get(), frame.data, frame.size);
  return Array::view(std::move(read.name), std::move(read.mesh), read.type, std::move(read.shape), copy, copy.get());
}

/// The part of a shared memory where an entry says that its array lies.
Frame frame_at(const Body& map, const Entry& read, SharedMemory* memory) {
  if (!memory) throw ProtocolError(fmt::format("array {} on {} lies in shared memory, which was not agreed on", read.name, read.mesh));
  const auto at = entry(map, "at", &Body::is_number_unsigned, "count").get<std::uint64_t>();
  const auto contents = memory->contents();
  if (at < SharedMemory::arrays_begin || read.bytes > contents.size() || at > contents.size() - read.bytes)
    throw ProtocolError(fmt::format("array {} on {}: {} bytes at {} are not within the {} of the shared memory", read.name, read.mesh, read.bytes, at,
                                    contents.size()));
  return {nullptr, contents.data() + at, static_cast<std::size_t>(read.bytes)};
}

bool is_in_memory(const Body& map) { return map.is_object() && map.contains("at"); }

}  // namespace

std::string encode_header(const Message& message, std::span<const std::uint64_t> offsets) {
  msgpack::sbuffer buffer;
  Packer packer(buffer);
  packer.pack_map(5);
  pack_text(packer, "acopla");
  packer.pack(version);
  pack_text(packer, "kind");
  pack_text(packer, name_of(message.kind));
  pack_text(packer, "sequence");
  packer.pack(message.sequence);
  pack_text(packer, "body");
  pack_value(packer, message.body);
  pack_text(packer, "arrays");
  packer.pack_array(static_cast<std::uint32_t>(message.arrays.size()));
  for (std::size_t k = 0; k < message.arrays.size(); ++k) {
    const auto& array = message.arrays[k];
    packer.pack_map(offsets.empty() ? 4 : 5);
    pack_text(packer, "name");
    pack_text(packer, array.name());
    pack_text(packer, "mesh");
    pack_text(packer, array.mesh());
    pack_text(packer, "type");
    pack_text(packer, name_of(array.type()));
    pack_text(packer, "shape");
    packer.pack_array(static_cast<std::uint32_t>(array.shape().size()));
    for (const auto extent : array.shape()) packer.pack(extent);
    if (offsets.empty()) continue;
    pack_text(packer, "at");
    packer.pack(offsets[k]);
  }
  return {buffer.data(), buffer.size()};
}

Message decode(std::span<const Frame> frames, const Limits& limits, SharedMemory* memory) {
  if (frames.empty()) throw ProtocolError("a message without frames");
  const auto header = unpack_header(frames[0], limits);
  const auto& spoken = entry(header, "acopla", &Body::is_number_unsigned, "count");
  Message message;
  message.kind = named(all_kinds, entry(header, "kind", &Body::is_string, "text").get<std::string>(), "kind");
  // A hello and an error are read whatever the version, so that two versions can tell each other so.
  if (spoken.get<std::uint64_t>() != version && message.kind != Kind::hello && message.kind != Kind::error)
    throw ProtocolError(fmt::format("a message of protocol version {}, this is version {}", spoken.get<std::uint64_t>(), version));
  message.sequence = entry(header, "sequence", &Body::is_number_unsigned, "count").get<std::uint64_t>();
  message.body = entry(header, "body", &Body::is_object, "map");
  const auto& arrays = entry(header, "arrays", &Body::is_array, "list");
  if (arrays.size() > limits.arrays) throw ProtocolError(fmt::format("{} arrays in one message", arrays.size()));
  const auto framed = arrays.size() - static_cast<std::size_t>(std::count_if(arrays.begin(), arrays.end(), is_in_memory));
  if (framed + 1 != frames.size())
    throw ProtocolError(fmt::format("the header names {} arrays, {} frames follow", framed, frames.size() - 1));
  auto frame = frames.begin();
  for (const auto& map : arrays) {
    auto read = read_entry(map);
    const auto lies = is_in_memory(map) ? frame_at(map, read, memory) : *++frame;
    message.arrays.push_back(array_of(std::move(read), lies));
  }
  return message;
}

}  // namespace acopla::protocol
