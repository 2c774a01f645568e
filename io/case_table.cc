#include "io/case_table.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <numeric>
#include <set>
#include <sstream>

// What toml++ 3.3 asserts of a text may be wrong, e.g. of the heading [.a]; with NDEBUG it lets the compiler take it for impossible. Here it is an error of the text.
namespace {
struct UnexpectedText {};
[[noreturn]] void unexpected_text() { throw UnexpectedText(); }
}  // namespace
#define TOML_ASSERT(expr) ((expr) ? static_cast<void>(0) : unexpected_text())
#ifdef NDEBUG
#undef NDEBUG
#include <toml++/toml.h>
#define NDEBUG
#else
#include <toml++/toml.h>
#endif

namespace acopla::io {

struct CaseDocument {
  std::string file;
  toml::table root;
  std::map<std::string, std::set<std::string>> asked;  // table name → keys somebody asked for
  std::set<std::string> skipped;                       // dotted paths that another process owns

  void mark(const std::string& table, std::string_view key) { asked[table].emplace(key); }
  Location at(const toml::source_region& region) const {
    return {file, static_cast<int>(region.begin.line), static_cast<int>(region.begin.column)};
  }
};

namespace {

const toml::table* as_table(const void* node) { return static_cast<const toml::table*>(node); }

const toml::node* find(const void* node, std::string_view key) {
  return node ? as_table(node)->get(key) : nullptr;
}

std::string join(const std::string& table, std::string_view key) {
  return table.empty() ? std::string(key) : fmt::format("{}.{}", table, key);
}

std::string kind_of(const toml::node& node) {
  switch (node.type()) {
    case toml::node_type::table: return "a table";
    case toml::node_type::array: return "a list";
    case toml::node_type::string: return "text";
    case toml::node_type::integer: return "an integer";
    case toml::node_type::floating_point: return "a number";
    case toml::node_type::boolean: return "true or false";
    default: return "a date or time";
  }
}

std::string number_text(double value) { return fmt::format("{:.10g}", value); }

}  // namespace

bool Range::contains(double value) const {
  const bool above = low_open ? value > low : value >= low;
  const bool below = high_open ? value < high : value <= high;
  return above && below;
}

std::string Range::text() const {
  const bool no_low = std::isinf(low), no_high = std::isinf(high);
  return fmt::format("{}{}, {}{}", low_open || no_low ? '(' : '[', no_low ? "-inf" : number_text(low),
                     no_high ? "inf" : number_text(high), high_open || no_high ? ')' : ']');
}

std::optional<std::string> nearest_word(std::string_view word, const std::vector<std::string>& known) {
  std::optional<std::string> best;
  // Of four letters or fewer two make another word: rate is no misspelt name.
  std::size_t best_distance = (word.size() <= 4 ? 1 : std::max<std::size_t>(2, word.size() / 3)) + 1;
  for (const auto& candidate : known) {
    // Optimal string alignment: a letter too many, missing or wrong counts one, and so do two that changed places.
    std::vector<std::size_t> before_last, last, row(candidate.size() + 1);
    std::iota(row.begin(), row.end(), std::size_t{0});
    for (std::size_t i = 1; i <= word.size(); ++i) {
      before_last = std::move(last);
      last = row;
      row[0] = i;
      for (std::size_t j = 1; j <= candidate.size(); ++j) {
        row[j] = std::min({last[j] + 1, row[j - 1] + 1, last[j - 1] + (word[i - 1] != candidate[j - 1])});
        if (i > 1 && j > 1 && word[i - 1] == candidate[j - 2] && word[i - 2] == candidate[j - 1]) row[j] = std::min(row[j], before_last[j - 2] + 1);
      }
    }
    if (row.back() < best_distance) {
      best_distance = row.back();
      best = candidate;
    }
  }
  return best;
}

Table::Table(std::shared_ptr<CaseDocument> document, const void* node, std::string name)
    : document_(std::move(document)), node_(node), name_(std::move(name)) {}

// The first line that is a heading of which no key can come; 0 where there is none.
static int line_of_bad_heading(std::string_view text) {
  int line = 0;
  while (!text.empty()) {
    ++line;
    const auto end = std::min(text.find('\n'), text.size());
    auto words = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    const auto after = [&](std::string_view skipped) { words.remove_prefix(std::min(words.find_first_not_of(skipped), words.size())); };
    after(" \t");
    if (!words.starts_with('[')) continue;
    after("[ \t");
    if (words.empty() || !(std::isalnum(static_cast<unsigned char>(words[0])) || std::string_view("_-\"'").find(words[0]) != std::string_view::npos)) return line;
  }
  return 0;
}

Table Table::from_file(const std::string& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored))
    throw UserError(fmt::format("{} is a folder. Name the case file in it, e.g. {}/case.toml.", path, path));
  std::ifstream stream(path, std::ios::binary);
  if (!stream)
    throw UserError(fmt::format("{}: the case file cannot be read. Check the path and its permissions.", path));
  std::stringstream text;
  text << stream.rdbuf();
  return from_text(text.str(), path);
}

Table Table::from_text(std::string_view text, const std::string& name) {
  auto document = std::make_shared<CaseDocument>();
  document->file = name;
  try {
    document->root = toml::parse(text, name);
  } catch (const toml::parse_error& error) {
    throw UserError(document->at(error.source()),
                    fmt::format("not valid TOML: {}. See https://toml.io for the format.", error.description()));
  } catch (const UnexpectedText&) {
    throw UserError({name, line_of_bad_heading(text), 0}, "not valid TOML: a heading, key or value begins with a character that none begins with. See https://toml.io for the format.");
  }
  const void* root = &document->root;
  return Table(std::move(document), root, "");
}

std::string Table::canonical(const std::vector<std::string>& but) const {
  auto root = document_->root;
  for (const auto& path : but) {
    auto* table = &root;
    std::size_t begin = 0;
    for (auto dot = path.find('.'); table && dot != std::string::npos; begin = dot + 1, dot = path.find('.', begin))
      table = (*table)[path.substr(begin, dot - begin)].as_table();
    if (table) table->erase(path.substr(begin));
  }
  std::stringstream text;
  text << toml::json_formatter(root);
  return text.str();
}

const std::string& Table::file() const { return document_->file; }

std::string Table::folder() const {
  return std::filesystem::absolute(document_->file).parent_path().string();
}

std::string Table::name_of(std::string_view key) const { return join(name_, key); }

Location Table::location() const {
  if (!node_ || name_.empty()) return {document_->file, 0, 0};
  return document_->at(as_table(node_)->source());
}

Location Table::location(std::string_view key) const {
  if (!node_) return location();
  for (const auto& [name, value] : *as_table(node_))
    if (name.str() == key) return document_->at(name.source());
  return location();
}

void Table::fail(std::string_view key, const std::string& sentence) const {
  throw UserError(location(key), fmt::format("{} {}", name_of(key), sentence));
}

void Table::fail(const std::string& sentence) const {
  throw UserError(location(), name_.empty() ? sentence : fmt::format("{} {}", name_, sentence));
}

bool Table::has(std::string_view key) const {
  document_->mark(name_, key);
  return find(node_, key) != nullptr;
}

namespace {

// The node of a key that must be there.
const toml::node& required(const Table& table, const void* node, std::string_view key) {
  if (!table.has(key)) {
    const auto near = nearest_word(key, table.keys());
    table.fail(near ? std::string_view(*near) : key,
               near ? fmt::format("stands where {} is missing. Is it misspelt?", key) : "is missing. Add it to this table.");
  }
  return *find(node, key);
}

double checked_number(const Table& table, std::string_view key, const toml::node& node, const Range& range) {
  const auto value = node.value<double>();
  if (!value || node.is_boolean()) table.fail(key, fmt::format("must be a number, not {}.", kind_of(node)));
  if (!std::isfinite(*value)) table.fail(key, fmt::format("= {} is not a finite number.", *value));
  if (!range.contains(*value))
    table.fail(key, fmt::format("= {} is outside {}.{}{}", number_text(*value), range.text(), *range.why ? " " : "",
                                range.why));
  return *value;
}

const toml::array& checked_list(const Table& table, std::string_view key, const toml::node& node,
                                std::string_view what) {
  const auto* list = node.as_array();
  if (!list) table.fail(key, fmt::format("must be a list of {}, not {}.", what, kind_of(node)));
  return *list;
}

Eigen::Vector3d checked_vector(const Table& table, std::string_view key, const toml::node& node, int dimension) {
  const auto& list = checked_list(table, key, node, fmt::format("{} numbers", dimension));
  if (list.size() != static_cast<std::size_t>(dimension))
    table.fail(key, fmt::format("must have {} components, not {}.", dimension, list.size()));
  Eigen::Vector3d vector = Eigen::Vector3d::Zero();
  for (int d = 0; d < dimension; ++d) vector[d] = checked_number(table, key, list[static_cast<std::size_t>(d)], any);
  return vector;
}

}  // namespace

double Table::number(std::string_view key, const Range& range) const {
  return checked_number(*this, key, required(*this, node_, key), range);
}

double Table::number(std::string_view key, const Range& range, double fallback) const {
  return has(key) ? number(key, range) : fallback;
}

std::optional<double> Table::optional_number(std::string_view key, const Range& range) const {
  return has(key) ? std::optional(number(key, range)) : std::nullopt;
}

std::int64_t Table::integer(std::string_view key, std::int64_t low, std::int64_t high) const {
  const auto& node = required(*this, node_, key);
  if (!node.is_integer()) fail(key, fmt::format("must be an integer, not {}.", kind_of(node)));
  const auto value = *node.value<std::int64_t>();
  if (value < low || value > high) fail(key, fmt::format("= {} is outside [{}, {}].", value, low, high));
  return value;
}

std::int64_t Table::integer(std::string_view key, std::int64_t low, std::int64_t high, std::int64_t fallback) const {
  return has(key) ? integer(key, low, high) : fallback;
}

bool Table::flag(std::string_view key, bool fallback) const {
  if (!has(key)) return fallback;
  const auto& node = *find(node_, key);
  if (!node.is_boolean()) fail(key, fmt::format("must be true or false, not {}.", kind_of(node)));
  return *node.value<bool>();
}

std::string Table::text(std::string_view key) const {
  const auto& node = required(*this, node_, key);
  if (!node.is_string()) fail(key, fmt::format("must be text in quotes, not {}.", kind_of(node)));
  return *node.value<std::string>();
}

std::string Table::text(std::string_view key, std::string_view fallback) const {
  return has(key) ? text(key) : std::string(fallback);
}

std::string Table::choice(std::string_view key, const std::vector<std::string>& choices) const {
  auto value = text(key);
  if (std::find(choices.begin(), choices.end(), value) == choices.end()) {
    const auto nearest = nearest_word(value, choices);
    fail(key, fmt::format("= \"{}\" is not one of \"{}\".{}", value, fmt::join(choices, "\", \""),
                          nearest ? fmt::format(" Did you mean \"{}\"?", *nearest) : ""));
  }
  return value;
}

std::string Table::choice(std::string_view key, const std::vector<std::string>& choices,
                          std::string_view fallback) const {
  return has(key) ? choice(key, choices) : std::string(fallback);
}

std::vector<double> Table::numbers(std::string_view key) const {
  std::vector<double> values;
  for (const auto& node : checked_list(*this, key, required(*this, node_, key), "numbers"))
    values.push_back(checked_number(*this, key, node, any));
  return values;
}

std::vector<std::string> Table::texts(std::string_view key) const {
  std::vector<std::string> values;
  for (const auto& node : checked_list(*this, key, required(*this, node_, key), "texts")) {
    if (!node.is_string()) fail(key, fmt::format("must be a list of texts, but holds {}.", kind_of(node)));
    values.push_back(*node.value<std::string>());
  }
  return values;
}

Eigen::Vector3d Table::vector(std::string_view key, int dimension) const {
  return checked_vector(*this, key, required(*this, node_, key), dimension);
}

std::vector<Eigen::Vector3d> Table::vectors(std::string_view key, int dimension) const {
  std::vector<Eigen::Vector3d> values;
  for (const auto& node : checked_list(*this, key, required(*this, node_, key), "points"))
    values.push_back(checked_vector(*this, key, node, dimension));
  return values;
}

std::vector<std::pair<std::string, std::string>> Table::text_pairs(std::string_view key) const {
  std::vector<std::pair<std::string, std::string>> pairs;
  for (const auto& node : checked_list(*this, key, required(*this, node_, key), "pairs of names")) {
    const auto* pair = node.as_array();
    if (!pair || pair->size() != 2 || !(*pair)[0].is_string() || !(*pair)[1].is_string())
      fail(key, "must be a list of pairs of names, e.g. [[\"glass\", \"steel\"]].");
    pairs.emplace_back(*(*pair)[0].value<std::string>(), *(*pair)[1].value<std::string>());
  }
  return pairs;
}

std::string Table::path(std::string_view key, bool must_exist) const { return full_path(key, text(key), must_exist); }

std::vector<std::string> Table::paths(std::string_view key) const {
  std::vector<std::string> full;
  for (const auto& given : texts(key)) full.push_back(full_path(key, given, true));
  return full;
}

std::string Table::full_path(std::string_view key, const std::string& given, bool must_exist) const {
  const auto full = (std::filesystem::path(folder()) / given).lexically_normal();
  std::error_code ignored;
  if (must_exist && !std::filesystem::exists(full, ignored))
    fail(key, fmt::format("= \"{}\" does not exist. Paths are relative to the case file; {} was looked for.", given,
                          full.string()));
  return full.string();
}

bool Table::is_text(std::string_view key) const { return has(key) && find(node_, key)->is_string(); }
bool Table::is_table(std::string_view key) const { return has(key) && find(node_, key)->is_table(); }
bool Table::is_number(std::string_view key) const { return has(key) && find(node_, key)->is_number(); }
bool Table::is_list_of_tables(std::string_view key) const {
  return has(key) && find(node_, key)->is_array_of_tables();
}

Table Table::table(std::string_view key) const {
  const auto& node = required(*this, node_, key);
  if (!node.is_table()) fail(key, fmt::format("must be a table, not {}.", kind_of(node)));
  return Table(document_, node.as_table(), name_of(key));
}

Table Table::table_or_empty(std::string_view key) const {
  return has(key) ? table(key) : Table(document_, nullptr, name_of(key));
}

std::vector<Table> Table::list(std::string_view key) const {
  std::vector<Table> tables;
  if (!has(key)) return tables;
  const auto& node = *find(node_, key);
  const auto* array = node.as_array();
  if (!array || (!array->empty() && !array->is_homogeneous(toml::node_type::table)))
    fail(key, fmt::format("must be a list of tables, written [[{}]], not {}.", name_of(key), kind_of(node)));
  for (std::size_t k = 0; k < array->size(); ++k)
    tables.push_back(Table(document_, (*array)[k].as_table(), fmt::format("{}[{}]", name_of(key), k)));
  return tables;
}

namespace {

// Keys in the order of the file: toml++ sorts them by name.
std::vector<std::string> ordered_keys(const toml::table& table) {
  std::vector<std::pair<toml::source_position, std::string>> found;
  for (const auto& [name, value] : table) found.emplace_back(name.source().begin, std::string(name.str()));
  std::sort(found.begin(), found.end(), [](const auto& a, const auto& b) {
    return std::pair(a.first.line, a.first.column) < std::pair(b.first.line, b.first.column);
  });
  std::vector<std::string> keys;
  for (auto& [position, key] : found) keys.push_back(std::move(key));
  return keys;
}

}  // namespace

std::vector<std::string> Table::keys() const {
  return node_ ? ordered_keys(*as_table(node_)) : std::vector<std::string>{};
}

std::vector<std::pair<std::string, Table>> Table::named_tables() const {
  std::vector<std::pair<std::string, Table>> tables;
  for (const auto& key : keys())
    if (is_table(key)) tables.emplace_back(key, table(key));
  return tables;
}

void Table::skip(std::string_view key) const {
  has(key);
  document_->skipped.insert(name_of(key));
}

namespace {

void reject_unknown_in(const CaseDocument& document, const toml::table& table, const std::string& name) {
  static const std::set<std::string> none;
  const auto found = document.asked.find(name);
  const auto& asked = found == document.asked.end() ? none : found->second;
  for (const auto& key : ordered_keys(table)) {
    const auto path = join(name, key);
    if (document.skipped.count(path)) continue;
    if (!asked.count(key)) {
      const std::vector<std::string> known(asked.begin(), asked.end());
      const auto nearest = nearest_word(key, known);
      Location where;
      for (const auto& [k, value] : table)
        if (k.str() == key) where = document.at(k.source());
      throw UserError(where, fmt::format("{} is not a known key. {}", path,
                                         nearest         ? fmt::format("Did you mean {}?", *nearest)
                                         : known.empty() ? std::string("Nothing is expected in this table.")
                                                         : fmt::format("Known here: {}.", fmt::join(known, ", "))));
    }
    const auto& node = *table.get(key);
    if (const auto* inner = node.as_table()) reject_unknown_in(document, *inner, path);
    if (const auto* list = node.as_array())
      for (std::size_t k = 0; k < list->size(); ++k)
        if (const auto* item = (*list)[k].as_table())
          reject_unknown_in(document, *item, fmt::format("{}[{}]", path, k));
  }
}

}  // namespace

void Table::reject_unknown() const {
  if (node_) reject_unknown_in(*document_, *as_table(node_), name_);
}

}  // namespace acopla::io
