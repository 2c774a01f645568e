// One message of the protocol: a small header, a body of named values, and raw arrays (docs/protocol.md, version 1).
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <nlohmann/json.hpp>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace acopla::protocol {

inline constexpr std::uint32_t version = 1;

enum class Kind : std::uint8_t {
  hello, welcome, interface, advance, advanced, save, restore, checkpoint, resume, finish, done, error, ping, pong
};
std::string_view name_of(Kind kind);

/// Something arrived that is not the protocol: truncated, deep, huge, wrongly shaped, or out of turn.
class ProtocolError : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

enum class ArrayType : std::uint8_t { f8, i4, u1 };  ///< little-endian double, 32-bit integer, byte
std::size_t bytes_of(ArrayType type);
std::string_view name_of(ArrayType type);

/// An array with a name. Shares its bytes: copying an Array is cheap and never copies the data, and bytes that arrived
/// aligned are read in place.
class Array {
 public:
  Array() = default;
  /// Takes over the values. @throws std::invalid_argument when the shape does not hold values.size() elements.
  static Array of(std::string name, std::string mesh, std::vector<std::uint64_t> shape, std::vector<double> values);
  static Array of(std::string name, std::string mesh, std::vector<std::uint64_t> shape, std::vector<std::int32_t> values);
  static Array of(std::string name, std::string mesh, std::vector<std::uint64_t> shape, std::vector<std::uint8_t> values);
  /// Wraps bytes that `owner` keeps alive; they must be aligned for the type and hold the shape exactly.
  static Array view(std::string name, std::string mesh, ArrayType type, std::vector<std::uint64_t> shape,
                    std::shared_ptr<const void> owner, const std::byte* data);

  const std::string& name() const { return name_; }  ///< e.g. "force"
  const std::string& mesh() const { return mesh_; }  ///< the surface it lives on, e.g. "box"
  ArrayType type() const { return type_; }
  const std::vector<std::uint64_t>& shape() const { return shape_; }
  std::size_t size() const { return size_; }  ///< number of elements
  std::span<const std::byte> bytes() const { return {data_, size_ * bytes_of(type_)}; }
  const std::shared_ptr<const void>& owner() const { return owner_; }

  /// The elements. @throws ProtocolError when the array is of another type.
  std::span<const double> doubles() const;
  std::span<const std::int32_t> integers() const;
  std::span<const std::uint8_t> octets() const;

 private:
  std::string name_, mesh_;
  ArrayType type_ = ArrayType::f8;
  std::vector<std::uint64_t> shape_;
  std::size_t size_ = 0;
  std::shared_ptr<const void> owner_;
  const std::byte* data_ = nullptr;
};

/// Values of a body: null, boolean, integer, double, text, list, map.
using Body = nlohmann::json;

struct Message {
  Kind kind = Kind::ping;
  std::uint64_t sequence = 0;  ///< a request's number; its answer carries the same
  Body body = Body::object();
  std::vector<std::pair<std::string, double>> values;  ///< the body's "values" in `advanced` and `done`, out of its tree since they are many
  std::vector<Array> arrays;

  /// @return the array of that name on that mesh, or nullptr
  const Array* find(std::string_view name, std::string_view mesh) const;
};

}  // namespace acopla::protocol
