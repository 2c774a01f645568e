#include "protocol/message.h"

#include <fmt/format.h>

#include <limits>

namespace acopla::protocol {

std::string_view name_of(Kind kind) {
  switch (kind) {
    case Kind::hello: return "hello";
    case Kind::welcome: return "welcome";
    case Kind::interface: return "interface";
    case Kind::advance: return "advance";
    case Kind::advanced: return "advanced";
    case Kind::save: return "save";
    case Kind::restore: return "restore";
    case Kind::checkpoint: return "checkpoint";
    case Kind::resume: return "resume";
    case Kind::finish: return "finish";
    case Kind::done: return "done";
    case Kind::error: return "error";
    case Kind::ping: return "ping";
    case Kind::pong: return "pong";
  }
  return "unknown";
}

std::size_t bytes_of(ArrayType type) {
  switch (type) {
    case ArrayType::f8: return 8;
    case ArrayType::i4: return 4;
    case ArrayType::u1: return 1;
  }
  return 0;
}

std::string_view name_of(ArrayType type) {
  switch (type) {
    case ArrayType::f8: return "f8";
    case ArrayType::i4: return "i4";
    case ArrayType::u1: return "u1";
  }
  return "unknown";
}

namespace {

std::size_t elements(const std::vector<std::uint64_t>& shape) {
  std::uint64_t product = 1;
  for (const auto extent : shape) {
    if (extent != 0 && product > std::numeric_limits<std::uint64_t>::max() / 8 / extent)
      throw std::invalid_argument("an array's shape is too large");
    product *= extent;
  }
  return static_cast<std::size_t>(product);
}

}  // namespace

Array Array::view(std::string name, std::string mesh, ArrayType type, std::vector<std::uint64_t> shape,
                  std::shared_ptr<const void> owner, const std::byte* data) {
  Array array;
  array.name_ = std::move(name);
  array.mesh_ = std::move(mesh);
  array.type_ = type;
  array.size_ = elements(shape);
  array.shape_ = std::move(shape);
  array.owner_ = std::move(owner);
  array.data_ = data;
  return array;
}

namespace {

template <class T>
Array owning(std::string name, std::string mesh, ArrayType type, std::vector<std::uint64_t> shape, std::vector<T> values) {
  if (elements(shape) != values.size()) throw std::invalid_argument("an array's shape does not hold its values");
  const auto owner = std::make_shared<const std::vector<T>>(std::move(values));
  const auto* data = reinterpret_cast<const std::byte*>(owner->data());
  return Array::view(std::move(name), std::move(mesh), type, std::move(shape), owner, data);
}

}  // namespace

Array Array::of(std::string name, std::string mesh, std::vector<std::uint64_t> shape, std::vector<double> values) {
  return owning(std::move(name), std::move(mesh), ArrayType::f8, std::move(shape), std::move(values));
}

Array Array::of(std::string name, std::string mesh, std::vector<std::uint64_t> shape, std::vector<std::int32_t> values) {
  return owning(std::move(name), std::move(mesh), ArrayType::i4, std::move(shape), std::move(values));
}

Array Array::of(std::string name, std::string mesh, std::vector<std::uint64_t> shape, std::vector<std::uint8_t> values) {
  return owning(std::move(name), std::move(mesh), ArrayType::u1, std::move(shape), std::move(values));
}

namespace {

void expect_type(const Array& array, ArrayType wanted) {
  if (array.type() != wanted)
    throw ProtocolError(fmt::format("array {} on {} is of type {}, {} was expected", array.name(), array.mesh(),
                                    name_of(array.type()), name_of(wanted)));
}

}  // namespace

std::span<const double> Array::doubles() const {
  expect_type(*this, ArrayType::f8);
  return {reinterpret_cast<const double*>(data_), size_};
}

std::span<const std::int32_t> Array::integers() const {
  expect_type(*this, ArrayType::i4);
  return {reinterpret_cast<const std::int32_t*>(data_), size_};
}

std::span<const std::uint8_t> Array::octets() const {
  expect_type(*this, ArrayType::u1);
  return {reinterpret_cast<const std::uint8_t*>(data_), size_};
}

const Array* Message::find(std::string_view name, std::string_view mesh) const {
  for (const auto& array : arrays)
    if (array.name() == name && array.mesh() == mesh) return &array;
  return nullptr;
}

}  // namespace acopla::protocol
