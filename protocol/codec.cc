#include "protocol/codec.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <limits>
#include <msgpack.hpp>
#include <optional>
#include <utility>

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

void pack_body(Packer& packer, const Message& message) {
  packer.pack_map(static_cast<std::uint32_t>(message.body.size() + (message.values.empty() ? 0 : 1)));
  for (const auto& [key, element] : message.body.items()) {
    pack_text(packer, key);
    pack_value(packer, element);
  }
  if (message.values.empty()) return;
  pack_text(packer, "values");
  packer.pack_array(static_cast<std::uint32_t>(message.values.size()));
  for (const auto& [name, number] : message.values) {
    packer.pack_array(2);
    pack_text(packer, name);
    packer.pack(number);
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

std::string_view text_of(const msgpack::object& object) {
  const std::string_view text(object.via.str.ptr, object.via.str.size);
  if (!is_utf8(text)) throw ProtocolError("the header holds text that is not UTF-8");
  return text;
}

std::string_view key_of(const msgpack::object_kv& pair) {
  if (pair.key.type != msgpack::type::STR) throw ProtocolError("a header map has a key that is not text");
  return text_of(pair.key);
}

[[noreturn]] void named_twice(std::string_view name) { throw ProtocolError(fmt::format("the header names \"{}\" twice", name)); }

Body unpack_value(const msgpack::object& object);

void add_to(Body::object_t& map, std::string_view name, const msgpack::object& value) {
  if (!map.emplace(name, unpack_value(value)).second) named_twice(name);
}

Body unpack_value(const msgpack::object& object) {
  switch (object.type) {
    case msgpack::type::NIL: return nullptr;
    case msgpack::type::BOOLEAN: return object.via.boolean;
    case msgpack::type::POSITIVE_INTEGER: return object.via.u64;
    case msgpack::type::NEGATIVE_INTEGER: return object.via.i64;
    case msgpack::type::FLOAT32:
    case msgpack::type::FLOAT64: return object.via.f64;
    case msgpack::type::STR: return text_of(object);
    case msgpack::type::ARRAY: {
      Body::array_t list;
      list.reserve(object.via.array.size);
      for (std::uint32_t k = 0; k < object.via.array.size; ++k) list.push_back(unpack_value(object.via.array.ptr[k]));
      return list;
    }
    case msgpack::type::MAP: {
      Body::object_t map;
      for (std::uint32_t k = 0; k < object.via.map.size; ++k) add_to(map, key_of(object.via.map.ptr[k]), object.via.map.ptr[k].val);
      return map;
    }
    default: throw ProtocolError("the header holds a value of a type the protocol does not use");
  }
}

std::optional<double> number(const msgpack::object& object) {
  switch (object.type) {
    case msgpack::type::POSITIVE_INTEGER: return static_cast<double>(object.via.u64);
    case msgpack::type::NEGATIVE_INTEGER: return static_cast<double>(object.via.i64);
    case msgpack::type::FLOAT32:
    case msgpack::type::FLOAT64: return object.via.f64;
    default: return std::nullopt;
  }
}

std::vector<std::pair<std::string, double>> unpack_pairs(const msgpack::object& object) {
  constexpr auto wrong = "\"values\" is not a list of [name, number]";
  if (object.type != msgpack::type::ARRAY) throw ProtocolError(wrong);
  std::vector<std::pair<std::string, double>> pairs;
  pairs.reserve(object.via.array.size);
  for (std::uint32_t k = 0; k < object.via.array.size; ++k) {
    const auto& each = object.via.array.ptr[k];
    const bool is_pair = each.type == msgpack::type::ARRAY && each.via.array.size == 2 && each.via.array.ptr[0].type == msgpack::type::STR;
    const auto value = is_pair ? number(each.via.array.ptr[1]) : std::nullopt;
    if (!value) throw ProtocolError(wrong);
    pairs.emplace_back(text_of(each.via.array.ptr[0]), *value);
  }
  return pairs;
}

void unpack_body(const msgpack::object& map, Message& message) {
  const bool reports = message.kind == Kind::advanced || message.kind == Kind::done;
  const msgpack::object* values = nullptr;
  Body::object_t body;
  for (std::uint32_t k = 0; k < map.via.map.size; ++k) {
    const auto& pair = map.via.map.ptr[k];
    const auto name = key_of(pair);
    if (!reports || name != "values") add_to(body, name, pair.val);
    else if (std::exchange(values, &pair.val)) named_twice(name);
  }
  message.body = std::move(body);
  if (values) message.values = unpack_pairs(*values);
}

/// The values of a map's entries that are known here; null where there is none. Those of later releases must be well formed too.
template <std::size_t N>
std::array<const msgpack::object*, N> known(const msgpack::object& map, const std::array<std::string_view, N>& names) {
  std::array<const msgpack::object*, N> values{};
  Body::object_t others;
  for (std::uint32_t k = 0; k < map.via.map.size; ++k) {
    const auto& pair = map.via.map.ptr[k];
    const auto name = key_of(pair);
    const auto found = std::find(names.begin(), names.end(), name);
    if (found == names.end()) add_to(others, name, pair.val);
    else if (std::exchange(values[static_cast<std::size_t>(found - names.begin())], &pair.val)) named_twice(name);
  }
  return values;
}

const msgpack::object& expect(const msgpack::object* value, msgpack::type::object_type type, const char* what, const char* key) {
  if (!value || value->type != type) throw ProtocolError(fmt::format("the header has no {} \"{}\"", what, key));
  return *value;
}

std::string_view text(const msgpack::object* value, const char* key) { return text_of(expect(value, msgpack::type::STR, "text", key)); }
std::uint64_t count(const msgpack::object* value, const char* key) { return expect(value, msgpack::type::POSITIVE_INTEGER, "count", key).via.u64; }
const msgpack::object_array& list(const msgpack::object* value, const char* key) { return expect(value, msgpack::type::ARRAY, "list", key).via.array; }

template <class Enum, std::size_t N>
Enum named(const std::array<Enum, N>& all, std::string_view name, const char* what) {
  for (const auto value : all)
    if (name_of(value) == name) return value;
  throw ProtocolError(fmt::format("\"{}\" is not a {} of protocol version {}", name.substr(0, 40), what, version));
}

/// The text in it stays where it is in the frame.
msgpack::object_handle unpack_header(const Frame& frame, const Limits& limits) {
  if (frame.size > limits.header_bytes)
    throw ProtocolError(fmt::format("a header of {} bytes is over the limit of {}", frame.size, limits.header_bytes));
  try {
    std::size_t used = 0;
    const msgpack::unpack_limit bounds(limits.elements, limits.elements, limits.header_bytes, limits.header_bytes,
                                       limits.header_bytes, limits.depth);
    const auto stays = [](msgpack::type::object_type, std::size_t, void*) { return true; };
    auto handle = msgpack::unpack(reinterpret_cast<const char*>(frame.data), frame.size, used, stays, nullptr, bounds);
    if (used != frame.size) throw ProtocolError(fmt::format("{} bytes follow the header's end", frame.size - used));
    if (handle->type != msgpack::type::MAP) throw ProtocolError("the header is not a map");
    return handle;
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
  const msgpack::object* at = nullptr;  // in shared memory
};

Entry read_entry(const msgpack::object& map) {
  if (map.type != msgpack::type::MAP) throw ProtocolError("an array's entry in the header is not a map");
  const auto [name, mesh, type, shape, at] = known<5>(map, {"name", "mesh", "type", "shape", "at"});
  Entry read{std::string(text(name, "name")), std::string(text(mesh, "mesh")), named(all_types, text(type, "type"), "type"), {}, 0, at};
  std::uint64_t without_zeros = read.bytes = bytes_of(read.type);
  const auto& extents = list(shape, "shape");
  constexpr std::size_t most_extents = 32;  // what NumPy can hold
  if (extents.size > most_extents) throw ProtocolError(fmt::format("array {} has an impossible shape", read.name));
  read.shape.reserve(extents.size);
  for (std::uint32_t k = 0; k < extents.size; ++k) {
    if (extents.ptr[k].type != msgpack::type::POSITIVE_INTEGER) throw ProtocolError(fmt::format("array {} has a shape that is not of counts", read.name));
    const auto extent = extents.ptr[k].via.u64;
    read.shape.push_back(extent);
    // Compared before use: a product that overflows or is larger than the frame never allocates anything.
    // Extents beside a zero too: readers in other languages multiply them before they see it.
    if (extent != 0 && without_zeros > (std::uint64_t{1} << 48) / extent)
      throw ProtocolError(fmt::format("array {} has an impossible shape", read.name));
    read.bytes *= extent;
    if (extent != 0) without_zeros *= extent;
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

/// Where an entry says that its array ends in shared memory.
std::uint64_t end_of(const Entry& read) {
  const auto at = count(read.at, "at");
  return at + std::min(read.bytes, std::numeric_limits<std::uint64_t>::max() - at);
}

/// What entries say that lies in shared memory, asked for at once: its place may change with its size.
std::span<const std::byte> contents_for(const std::vector<Entry>& entries, SharedMemory* memory) {
  std::uint64_t end = 0;
  for (const auto& read : entries) {
    if (!read.at) continue;
    if (!memory) throw ProtocolError(fmt::format("array {} on {} lies in shared memory, which was not agreed on", read.name, read.mesh));
    end = std::max(end, end_of(read));
  }
  return end > 0 ? memory->contents(end) : std::span<const std::byte>();
}

Frame frame_at(const Entry& read, std::span<const std::byte> contents) {
  const auto at = count(read.at, "at");
  if (at < SharedMemory::arrays_begin || end_of(read) > contents.size())
    throw ProtocolError(fmt::format("array {} on {}: {} bytes at {} are not within the {} of the shared memory", read.name, read.mesh, read.bytes, at,
                                    contents.size()));
  return {nullptr, contents.data() + at, static_cast<std::size_t>(read.bytes)};
}

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
  pack_body(packer, message);
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
  const auto handle = unpack_header(frames[0], limits);
  const auto [spoken, kind, sequence, body, arrays] = known<5>(handle.get(), {"acopla", "kind", "sequence", "body", "arrays"});
  const auto spoken_version = count(spoken, "acopla");
  Message message;
  message.kind = named(all_kinds, text(kind, "kind"), "kind");
  // A hello and an error are read whatever the version, so that two versions can tell each other so.
  if (spoken_version != version && message.kind != Kind::hello && message.kind != Kind::error)
    throw ProtocolError(fmt::format("a message of protocol version {}, this is version {}", spoken_version, version));
  message.sequence = count(sequence, "sequence");
  unpack_body(expect(body, msgpack::type::MAP, "map", "body"), message);
  const auto& entries = list(arrays, "arrays");
  if (entries.size > limits.arrays) throw ProtocolError(fmt::format("{} arrays in one message", entries.size));
  std::vector<Entry> read;
  read.reserve(entries.size);
  for (std::uint32_t k = 0; k < entries.size; ++k) read.push_back(read_entry(entries.ptr[k]));
  const auto framed = static_cast<std::size_t>(std::count_if(read.begin(), read.end(), [](const Entry& each) { return !each.at; }));
  if (framed + 1 != frames.size())
    throw ProtocolError(fmt::format("the header names {} arrays, {} frames follow", framed, frames.size() - 1));
  const auto contents = contents_for(read, memory);
  auto frame = frames.begin();
  message.arrays.reserve(read.size());
  for (auto& each : read) {
    const auto lies = each.at ? frame_at(each, contents) : *++frame;
    message.arrays.push_back(array_of(std::move(each), lies));
  }
  return message;
}

}  // namespace acopla::protocol
