// How a solver saves and restores its whole state bit for bit: one description, two archives over a buffer in memory.
#pragma once

#include <array>
#include <cassert>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace acopla::io {

/// What one element of a saved array is made of. A `record` is bytes of which nothing else is known.
struct Element {
  enum class Kind : std::uint8_t { boolean, signed_integer, unsigned_integer, real, text, record };
  Kind kind = Kind::record;
  std::uint32_t component_bytes = 1;
  std::uint32_t components = 1;  ///< e.g. 3 for a vector of three doubles

  std::size_t bytes() const { return std::size_t{component_bytes} * components; }
  std::string text() const;  ///< "float64[3]", "int32", "bool", "record of 48 bytes"
  bool operator==(const Element&) const = default;
};

/// A saved state: named arrays of raw bytes, in the order they were saved, in one buffer that is kept from save to save.
class State {
 public:
  struct Entry {
    std::string_view name;
    Element element;
    std::size_t count = 0;  ///< elements
    std::span<const std::byte> bytes;
    std::size_t next = 0;  ///< where the next entry begins
  };

  State() = default;
  State(const State&) = default;
  State(State&& other) noexcept { swap(other); }
  State& operator=(State other) noexcept {
    swap(other);
    return *this;
  }
  ~State() = default;
  void swap(State& other) noexcept;

  void clear();  ///< forgets the arrays and keeps the memory
  void reserve(std::size_t bytes);
  bool empty() const { return used_ == 0; }
  std::size_t bytes() const { return used_; }  ///< in use, names and padding included
  std::size_t capacity() const { return lines_.size() * sizeof(Line); }

  /// Adds an array. @return where its count × element.bytes() bytes go; valid until the next append()
  std::byte* append(std::string_view name, const Element& element, std::size_t count);
  /// @param offset  0, or `next` of another entry; below bytes()
  Entry entry(std::size_t offset) const;

  /// The file the state was read from, named by messages; empty for one that never left memory.
  const std::string& source() const { return source_; }
  void set_source(std::string path) { source_ = std::move(path); }

  /// Same names, types and bits in the same order. Padding inside records counts.
  friend bool operator==(const State& a, const State& b);

 private:
  struct alignas(64) Line {  // arrays begin on a cache line
    std::byte bytes[64];
  };
  std::byte* data() { return reinterpret_cast<std::byte*>(lines_.data()); }
  const std::byte* data() const { return reinterpret_cast<const std::byte*>(lines_.data()); }

  std::vector<Line> lines_;
  std::size_t used_ = 0;
  std::string source_;
};

namespace archive {

template <class T>
inline constexpr bool is_pair = false;
template <class A, class B>
inline constexpr bool is_pair<std::pair<A, B>> = true;
template <class T>
inline constexpr bool is_vector = false;
template <class T>
inline constexpr bool is_vector<std::vector<T>> = true;
template <class T>
inline constexpr bool is_span = false;
template <class T>
inline constexpr bool is_span<std::span<T>> = true;
template <class T>
inline constexpr bool is_array = false;
template <class T, std::size_t n>
inline constexpr bool is_array<std::array<T, n>> = true;

/// Has a member `template <class Archive> void state(Archive&)`.
template <class T, class Archive>
concept HasState = requires(T& value, Archive& archive) {
  value.state(archive);
};

template <class T>
concept Number = std::is_enum_v<T> ||(std::is_arithmetic_v<T> && sizeof(T) <= 8);

/// A matrix of Eigen that holds its numbers itself. Eigen writes its own copy constructors, so that the language does not
/// count these as trivially copyable, although they are nothing but their numbers.
template <class T>
concept FixedEigen = requires(T& value) {
  typename T::Scalar;
  requires std::same_as<typename T::PlainObject, T>;
  requires Number<typename T::Scalar>;
  requires int{T::SizeAtCompileTime} > 0;
  requires sizeof(T) == std::size_t{T::SizeAtCompileTime} * sizeof(typename T::Scalar);
  value.data();
};

/// A vector of Eigen whose length is known at run time.
template <class T>
concept LongEigen = requires(T& value) {
  typename T::Scalar;
  requires std::same_as<typename T::PlainObject, T>;
  requires Number<typename T::Scalar>;
  requires int{T::SizeAtCompileTime} < 0 && int{T::ColsAtCompileTime} == 1;
  value.resize(1);
};

template <class T>
inline constexpr bool plain_array = false;

/// Saved and restored by copying its bytes. Pointers and what looks at the memory of others (views) are not.
template <class T>
concept Plain = Number<T> || FixedEigen<T> || plain_array<T> ||
    (std::is_class_v<T>&& std::is_trivially_copyable_v<T> && !is_pair<T> && !is_array<T> &&
     !requires(T & value) { value.begin(); });

template <class T, std::size_t n>
inline constexpr bool plain_array<std::array<T, n>> = Plain<T>;

template <class T>
constexpr Element element_of_type() {
  if constexpr (std::is_enum_v<T>) {
    return element_of_type<std::underlying_type_t<T>>();
  } else if constexpr (Number<T>) {
    const auto kind = std::same_as<T, bool>         ? Element::Kind::boolean
                      : std::is_floating_point_v<T> ? Element::Kind::real
                      : std::is_signed_v<T>         ? Element::Kind::signed_integer
                                                    : Element::Kind::unsigned_integer;
    return {kind, sizeof(T), 1};
  } else if constexpr (FixedEigen<T>) {
    auto element = element_of_type<typename T::Scalar>();
    element.components = T::SizeAtCompileTime;
    return element;
  } else if constexpr (plain_array<T>) {
    auto element = element_of_type<typename T::value_type>();
    element.components *= static_cast<std::uint32_t>(std::tuple_size_v<T>);
    return element;
  } else {
    return {Element::Kind::record, sizeof(T), 1};
  }
}

}  // namespace archive

/// What a plain type is made of. Specialise it for a record of equal numbers, so that files show numbers and not bytes:
///   template <>
///   inline constexpr Element acopla::io::element_of<Record> = {Element::Kind::real, 8, 4};
template <class T>
inline constexpr Element element_of = archive::element_of_type<T>();

/// What both archives share: which types there are, and which arrays each becomes. A type describes itself once,
///   template <class Archive> void state(Archive& a) { a("position", position_); a("rebuilds", rebuilds_); ... }
/// and `Archive::reading` tells where more is to be done after restoring. Bits are kept exactly. Taken are:
///   numbers, bool, enums, std::string, fixed-size Eigen matrices,
///   std::array of what is copied byte by byte                         one array
///   structures of these that can be copied byte by byte               one array of records (padding is saved as it is, and no
///                                                                     compiler tells a pointer inside: those need state())
///   std::span of these                                                one array, whose size must be the same on restoring
///   std::vector of these, std::vector<bool>, vectors of Eigen         one array
///   std::vector of std::vector of these, or of std::string            NAME.sizes, and NAME with the rows end to end
///   std::vector of pairs of these                                     NAME.first, NAME.second
///   objects with state(Archive&), pairs, other std::array             NAME.MEMBER, NAME.first and NAME.second, NAME[k]
///   std::vector of anything else above                                NAME.size and NAME[k]: for few, not for particles
template <class Self>
class Archive {
 protected:
  template <class T>
  void named(std::string_view name, T& value) {
    const auto outer = path_.size();
    if (!path_.empty()) path_ += '.';
    path_ += name;
    visit(value);
    path_.resize(outer);
  }

  std::string path_;  ///< dotted name of what is being visited

 private:
  Self& self() { return static_cast<Self&>(*this); }

  // What has a state() of its own is never copied byte by byte, in an array neither.
  template <class T>
  static constexpr bool is_plain() {
    if constexpr (archive::HasState<T, Self>) {
      return false;
    } else if constexpr (archive::is_array<T>) {
      return is_plain<typename T::value_type>();
    } else {
      return archive::Plain<T>;
    }
  }
  template <class T>
  static constexpr bool plain = is_plain<T>();

  template <class T>
  void visit(T& value) {
    static_assert(!std::is_pointer_v<T>, "A pointer means nothing after a restart: save what it points to, or an index.");
    if constexpr (archive::HasState<T, Self>) {
      value.state(self());
    } else if constexpr (plain<T>) {
      self().begin_exactly(element_of<T>, 1);
      self().copy(&value, sizeof(T));
    } else if constexpr (std::same_as<T, std::string>) {
      value.resize(self().begin(text_, value.size()));
      self().copy(value.data(), value.size());
    } else if constexpr (archive::LongEigen<T>) {
      value.resize(static_cast<typename T::Index>(self().begin(element_of<typename T::Scalar>, static_cast<std::size_t>(value.size()))));
      self().copy(value.data(), static_cast<std::size_t>(value.size()) * sizeof(typename T::Scalar));
    } else if constexpr (archive::is_pair<T>) {
      named("first", value.first);
      named("second", value.second);
    } else if constexpr (archive::is_span<T>) {
      static_assert(plain<typename T::value_type>, "A span is saved when its elements can be copied byte by byte.");
      self().begin_exactly(element_of<typename T::value_type>, value.size());
      self().copy(value.data(), value.size_bytes());
    } else if constexpr (archive::is_vector<T>) {
      visit_vector(value);
    } else if constexpr (archive::is_array<T>) {
      for (std::size_t k = 0; k < value.size(); ++k) indexed(k, value[k]);
    } else {
      static_assert(sizeof(T) == 0, "This type cannot be saved: give it a member template <class Archive> void state(Archive&).");
    }
  }

  template <class T>
  void visit_vector(std::vector<T>& values) {
    if constexpr (std::same_as<T, bool>) {
      visit_bits(values);
    } else if constexpr (plain<T>) {
      values.resize(self().begin(element_of<T>, values.size()));
      self().copy(values.data(), values.size() * sizeof(T));
    } else if constexpr (is_row<T>()) {
      visit_rows(values);
    } else if constexpr (is_plain_pair<T>()) {
      visit_pairs(values);
    } else {
      auto count = static_cast<std::uint64_t>(values.size());
      named("size", count);
      if constexpr (std::is_default_constructible_v<T>) {
        values.resize(count);
      } else {
        self().expect_size(count, values.size());  // such objects cannot be made here
      }
      for (std::size_t k = 0; k < values.size(); ++k) indexed(k, values[k]);
    }
  }

  template <class T>
  static constexpr bool is_row() {
    if constexpr (std::same_as<T, std::string>) {
      return true;
    } else if constexpr (archive::is_vector<T>) {
      return plain<typename T::value_type> && !std::same_as<typename T::value_type, bool>;
    } else {
      return false;
    }
  }

  template <class T>
  static constexpr bool is_plain_pair() {
    if constexpr (archive::is_pair<T>) {
      return plain<typename T::first_type> && plain<typename T::second_type>;
    } else {
      return false;
    }
  }

  void visit_bits(std::vector<bool>& values) {
    values.resize(self().begin(element_of<bool>, values.size()));
    for (std::size_t k = 0; k < values.size(); ++k) {
      bool bit = values[k];
      self().copy(&bit, 1);
      if constexpr (Self::reading) values[k] = bit;
    }
  }

  template <class Row>
  void visit_rows(std::vector<Row>& rows) {
    std::size_t total = 0;
    path_ += ".sizes";
    rows.resize(self().begin(element_of<std::uint64_t>, rows.size()));
    for (auto& row : rows) {
      auto size = static_cast<std::uint64_t>(row.size());
      self().copy(&size, sizeof(size));
      row.resize(size);
      total += row.size();
    }
    path_.resize(path_.size() - 6);
    using Value = typename Row::value_type;
    self().begin_exactly(std::same_as<Row, std::string> ? text_ : element_of<Value>, total);
    for (auto& row : rows) self().copy(row.data(), row.size() * sizeof(Value));
  }

  template <class A, class B>
  void visit_pairs(std::vector<std::pair<A, B>>& pairs) {
    path_ += ".first";
    pairs.resize(self().begin(element_of<A>, pairs.size()));
    for (auto& pair : pairs) self().copy(&pair.first, sizeof(A));
    path_.resize(path_.size() - 6);
    path_ += ".second";
    self().begin_exactly(element_of<B>, pairs.size());
    for (auto& pair : pairs) self().copy(&pair.second, sizeof(B));
    path_.resize(path_.size() - 7);
  }

  template <class T>
  void indexed(std::size_t k, T& value) {
    const auto outer = path_.size();
    path_ += '[';
    path_ += std::to_string(k);
    path_ += ']';
    visit(value);
    path_.resize(outer);
  }

  static constexpr Element text_{Element::Kind::text, 1, 1};
};

/// Saves what it is given at the end of a State.
class StateWriter : public Archive<StateWriter> {
 public:
  static constexpr bool reading = false;
  explicit StateWriter(State& state) : state_(state) {}

  template <class T>
  void operator()(std::string_view name, const T& value) {
    named(name, const_cast<T&>(value));  // only read: state() is not const because restoring shares it
  }

 private:
  friend class Archive<StateWriter>;
  std::size_t begin(const Element& element, std::size_t count) {
    cursor_ = state_.append(path_, element, count);
    return count;
  }
  void begin_exactly(const Element& element, std::size_t count) { begin(element, count); }
  void expect_size(std::size_t, std::size_t) {}
  void copy(const void* from, std::size_t bytes) {
    if (bytes) std::memcpy(cursor_, from, bytes);
    cursor_ += bytes;
  }

  State& state_;
  std::byte* cursor_ = nullptr;
};

/// Restores in the order of saving. @throws UserError when the next array has another name, type or size than what is asked
/// for; what was restored until then stays, so that the object is of no use any more
class StateReader : public Archive<StateReader> {
 public:
  static constexpr bool reading = true;
  explicit StateReader(const State& state) : state_(state) {}  ///< the state must outlive the reader

  template <class T>
  void operator()(std::string_view name, T&& value) {
    named(name, value);
  }
  /// @throws UserError when arrays are left that nobody asked for
  void finish() const;

 private:
  friend class Archive<StateReader>;
  std::size_t begin(const Element& element, std::size_t count);  ///< @return the saved count, whatever was given
  void begin_exactly(const Element& element, std::size_t count);
  void expect_size(std::size_t saved, std::size_t given) const;
  void copy(void* to, std::size_t bytes) {
    assert(bytes <= left_.size());
    if (bytes) std::memcpy(to, left_.data(), bytes);
    left_ = left_.subspan(bytes);
  }
  [[noreturn]] void fail(const std::string& sentence) const;

  const State& state_;
  std::size_t next_ = 0;
  std::span<const std::byte> left_;  ///< of the array begun last
};

/// Saves the object over what the state held.
template <class T>
void save(const T& object, State& state) {
  state.clear();
  StateWriter writer(state);
  const_cast<T&>(object).state(writer);
}

/// Restores the object from a state saved by the same description. @throws UserError as StateReader, and when arrays are left
template <class T>
void restore(const State& state, T& object) {
  StateReader reader(state);
  object.state(reader);
  reader.finish();
}

}  // namespace acopla::io
