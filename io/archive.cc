#include "io/archive.h"

#include <fmt/format.h>

#include <algorithm>

#include "io/error.h"

namespace acopla::io {
namespace {

// What stands before the bytes of an array. The name follows, then zeros up to the next line.
struct Heading {
  std::uint64_t count = 0;
  std::uint32_t name_bytes = 0;
  std::uint32_t component_bytes = 0;
  std::uint32_t components = 0;
  std::uint32_t kind = 0;
};
static_assert(sizeof(Heading) == 24, "no padding, so that equal states have equal bytes");

constexpr std::size_t whole_lines(std::size_t bytes, std::size_t line) { return (bytes + line - 1) / line * line; }

}  // namespace

std::string Element::text() const {
  std::string name;
  switch (kind) {
    case Kind::boolean:
      name = "bool";
      break;
    case Kind::signed_integer:
      name = fmt::format("int{}", 8 * component_bytes);
      break;
    case Kind::unsigned_integer:
      name = fmt::format("uint{}", 8 * component_bytes);
      break;
    case Kind::real:
      name = fmt::format("float{}", 8 * component_bytes);
      break;
    case Kind::text:
      name = "text";
      break;
    case Kind::record:
      name = fmt::format("record of {} bytes", component_bytes);
      break;
  }
  return components == 1 ? name : fmt::format("{}[{}]", name, components);
}

void State::swap(State& other) noexcept {
  lines_.swap(other.lines_);
  std::swap(used_, other.used_);
  source_.swap(other.source_);
}

void State::clear() {
  used_ = 0;
  source_.clear();
}

void State::reserve(std::size_t bytes) {
  const auto lines = whole_lines(bytes, sizeof(Line)) / sizeof(Line);
  if (lines > lines_.size()) lines_.resize(lines);
}

std::byte* State::append(std::string_view name, const Element& element, std::size_t count) {
  const auto heading_bytes = whole_lines(sizeof(Heading) + name.size(), sizeof(Line));
  const auto bytes = count * element.bytes();
  const auto end = used_ + heading_bytes + whole_lines(bytes, sizeof(Line));
  if (end > capacity()) reserve(std::max(end, 2 * capacity()));

  const Heading heading{count, static_cast<std::uint32_t>(name.size()), element.component_bytes, element.components,
                        static_cast<std::uint32_t>(element.kind)};
  auto* at = data() + used_;
  std::memcpy(at, &heading, sizeof(heading));
  std::copy_n(reinterpret_cast<const std::byte*>(name.data()), name.size(), at + sizeof(heading));
  std::fill(at + sizeof(heading) + name.size(), at + heading_bytes, std::byte{});
  auto* const values = at + heading_bytes;
  std::fill(values + bytes, data() + end, std::byte{});
  used_ = end;
  return values;
}

State::Entry State::entry(std::size_t offset) const {
  assert(offset < used_);
  const auto* at = data() + offset;
  Heading heading;
  std::memcpy(&heading, at, sizeof(heading));
  Entry entry;
  entry.name = {reinterpret_cast<const char*>(at + sizeof(heading)), heading.name_bytes};
  entry.element = {static_cast<Element::Kind>(heading.kind), heading.component_bytes, heading.components};
  entry.count = heading.count;
  const auto heading_bytes = whole_lines(sizeof(heading) + heading.name_bytes, sizeof(Line));
  entry.bytes = {at + heading_bytes, entry.count * entry.element.bytes()};
  entry.next = offset + heading_bytes + whole_lines(entry.bytes.size(), sizeof(Line));
  return entry;
}

bool operator==(const State& a, const State& b) {
  return a.used_ == b.used_ && (a.used_ == 0 || std::memcmp(a.data(), b.data(), a.used_) == 0);
}

std::size_t StateReader::begin(const Element& element, std::size_t) {
  if (next_ >= state_.bytes()) fail(fmt::format("the saved state ends where \"{}\" should follow.", path_));
  const auto entry = state_.entry(next_);
  if (entry.name != path_) fail(fmt::format("the saved state has \"{}\" where \"{}\" should be.", entry.name, path_));
  if (entry.element != element)
    fail(fmt::format("\"{}\" was saved as {} and should be {}.", path_, entry.element.text(), element.text()));
  next_ = entry.next;
  left_ = entry.bytes;
  return entry.count;
}

void StateReader::begin_exactly(const Element& element, std::size_t count) { expect_size(begin(element, count), count); }

void StateReader::expect_size(std::size_t saved, std::size_t given) const {
  if (saved != given) fail(fmt::format("\"{}\" was saved with size {} and should have size {}.", path_, saved, given));
}

void StateReader::finish() const {
  if (next_ < state_.bytes())
    fail(fmt::format("the saved state goes on with \"{}\" where it should end.", state_.entry(next_).name));
}

void StateReader::fail(const std::string& sentence) const {
  throw UserError({state_.source(), 0, 0},
                  sentence +
                      " It was saved by another version of the program or from another case: restore it with those, or "
                      "start the run from its beginning.");
}

}  // namespace acopla::io
