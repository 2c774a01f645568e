#include "dem/laws_table.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <map>

#include "dem/laws.h"

namespace acopla::dem {
namespace {

std::string fallback(const Field& field) {
  if (field.fallback == Field::required) return "required";
  if (field.fallback == Field::optional) return "–";
  return fmt::format("{}", field.fallback);
}

std::string range(const Field& field) {
  if (std::isfinite(field.range.high)) return field.range.text();
  return field.range.low == 0 ? (field.range.low_open ? "> 0" : "≥ 0") : field.range.text();
}

std::string rows(const char* key, const std::vector<std::string>& names, const LawInfo* (Laws::*find)(const std::string&) const, const Laws& laws) {
  std::string text;
  for (const auto& name : names) {
    const auto* law = (laws.*find)(name);
    if (law->fields.empty()) text += fmt::format("| `{}` | `\"{}\"` | | | | | |\n", key, name);
    for (const auto& field : law->fields)
      text += fmt::format("| `{}` | `\"{}\"` | `{}` | {} | {} | {} | {} |\n", key, name, field.key, field.unit, range(field), fallback(field), field.doc);
  }
  return text;
}

}  // namespace

std::string laws_table(const Laws& laws) {
  std::string text = "| key | law | its number | unit | range | default | meaning |\n| --- | --- | --- | --- | --- | --- | --- |\n";
  text += rows("normal", laws.normals(), &Laws::normal, laws);
  text += rows("tangential", laws.tangentials(), &Laws::tangential, laws);
  text += rows("rolling", laws.rollings(), &Laws::rolling, laws);
  text += "\n| normal | tangential | rolling |\n| --- | --- | --- |\n";
  std::vector<std::pair<std::string, std::string>> order;
  std::map<std::pair<std::string, std::string>, std::vector<std::string>> with;
  for (const auto& set : laws.combinations()) {
    auto& rolling = with[{set.normal, set.tangential}];
    if (rolling.empty()) order.emplace_back(set.normal, set.tangential);
    rolling.push_back(set.rolling);
  }
  for (const auto& pair : order) text += fmt::format("| `{}` | `{}` | `{}` |\n", pair.first, pair.second, fmt::join(with[pair], "`, `"));
  return text;
}

}  // namespace acopla::dem
