// The case file: a reader that knows where each key stands, which keys were asked for, and which were never used.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "io/error.h"

namespace acopla::io {

/// An interval a number must lie in, with its words for the message.
struct Range {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  bool low_open = false, high_open = false;
  const char* why = "";  ///< one sentence that tells the reader why, e.g. "A density is positive."
  bool contains(double value) const;
  std::string text() const;  ///< "(-1, 0.5)"
};

inline constexpr Range any{};
inline constexpr Range positive{0, std::numeric_limits<double>::infinity(), true, false, ""};
inline constexpr Range non_negative{0, std::numeric_limits<double>::infinity(), false, false, ""};
inline constexpr Range fraction{0, 1, false, false, ""};

struct CaseDocument;  // the parsed file, and what was asked of it

/// One table of a case. Cheap to copy; all copies share the record of used keys. Every reader throws UserError, located
/// at the key (or at the table's heading when the key is missing), for a missing key, a wrong type, a value that is not
/// finite or out of range.
class Table {
 public:
  /// Reads a case file. @throws UserError when it cannot be read or is not TOML.
  static Table from_file(const std::string& path);
  /// The same from text; `name` stands for the file in messages.
  static Table from_text(std::string_view text, const std::string& name);

  bool has(std::string_view key) const;

  double number(std::string_view key, const Range& range = any) const;
  double number(std::string_view key, const Range& range, double fallback) const;
  std::optional<double> optional_number(std::string_view key, const Range& range = any) const;
  std::int64_t integer(std::string_view key, std::int64_t low, std::int64_t high) const;
  std::int64_t integer(std::string_view key, std::int64_t low, std::int64_t high, std::int64_t fallback) const;
  bool flag(std::string_view key, bool fallback) const;
  std::string text(std::string_view key) const;
  std::string text(std::string_view key, std::string_view fallback) const;
  /// A text that must be one of `choices`; the message lists them and names the nearest.
  std::string choice(std::string_view key, const std::vector<std::string>& choices) const;
  std::string choice(std::string_view key, const std::vector<std::string>& choices, std::string_view fallback) const;
  std::vector<double> numbers(std::string_view key) const;
  std::vector<std::string> texts(std::string_view key) const;
  /// A vector of `dimension` (2 or 3) numbers; in 2D the third component is 0.
  Eigen::Vector3d vector(std::string_view key, int dimension) const;
  /// A list of `dimension`-vectors, e.g. the two corners of a box.
  std::vector<Eigen::Vector3d> vectors(std::string_view key, int dimension) const;
  /// A list of pairs of texts, e.g. [["glass", "glass"], ["glass", "steel"]].
  std::vector<std::pair<std::string, std::string>> text_pairs(std::string_view key) const;
  /// A path, made absolute against the case file's folder. @throws UserError when `must_exist` and it does not.
  std::string path(std::string_view key, bool must_exist = true) const;
  /// A list of paths that must exist.
  std::vector<std::string> paths(std::string_view key) const;

  /// True where the key holds text, a table, a list of tables.
  bool is_text(std::string_view key) const;
  bool is_table(std::string_view key) const;
  bool is_list_of_tables(std::string_view key) const;
  bool is_number(std::string_view key) const;
  /// A sub-table; without the key a missing-key error. `table_or_empty` gives an empty one instead.
  Table table(std::string_view key) const;
  Table table_or_empty(std::string_view key) const;
  /// [[key]] tables in order; empty without the key.
  std::vector<Table> list(std::string_view key) const;
  /// All sub-tables of this table with their names, in the order of the file. Marks them used.
  std::vector<std::pair<std::string, Table>> named_tables() const;
  /// Keys in the order of the file.
  std::vector<std::string> keys() const;

  /// Marks a key and everything under it as used, unread (another process owns it).
  void skip(std::string_view key) const;
  /// @throws UserError for the first key of this table or of any table under it that nobody asked for; the message names
  /// the nearest key that somebody did ask for.
  void reject_unknown() const;

  /// Dotted path of this table, e.g. "grains.material.glass"; empty for the root.
  const std::string& name() const { return name_; }
  std::string name_of(std::string_view key) const;
  Location location() const;
  Location location(std::string_view key) const;
  /// Throws a UserError located at `key`: "case.toml:31:12: grains.material.glass.poisson SENTENCE".
  [[noreturn]] void fail(std::string_view key, const std::string& sentence) const;
  /// The same, located at the heading of this table.
  [[noreturn]] void fail(const std::string& sentence) const;
  /// What the case says, but for the order of keys, comments, and the keys `but` (dotted paths): equal texts say the same.
  std::string canonical(const std::vector<std::string>& but) const;
  const std::string& file() const;    ///< path of the case file as given
  std::string folder() const;         ///< absolute folder of the case file

 private:
  std::string full_path(std::string_view key, const std::string& given, bool must_exist) const;
  Table(std::shared_ptr<CaseDocument> document, const void* node, std::string name);
  std::shared_ptr<CaseDocument> document_;
  const void* node_ = nullptr;  // a toml::table, or null for an empty one
  std::string name_;
  friend struct CaseDocument;
};

/// The nearest of `known` to `word` by edit distance, or nothing where none is near.
std::optional<std::string> nearest_word(std::string_view word, const std::vector<std::string>& known);

}  // namespace acopla::io
