#include "conformance/report.h"

#include <fmt/format.h>

#include <algorithm>

namespace acopla::conformance {

const Finding& Report::of(std::string_view rule) const {
  static const Finding none;
  const auto found = findings_.find(rule);
  return found == findings_.end() ? none : found->second;
}

std::size_t Report::count(Verdict verdict) const {
  return static_cast<std::size_t>(std::count_if(rules.begin(), rules.end(), [&](const Rule& rule) { return of(rule.name).verdict == verdict; }));
}

std::string Report::text() const {
  std::string text;
  for (const auto& rule : rules) {
    const auto& finding = of(rule.name);
    const auto line = [&](const char* word, const std::string& what) {
      text += fmt::format("  {:7} {:15} {}  {}\n", word, rule.name, rule.section, what);
    };
    switch (finding.verdict) {
      case Verdict::kept: line("kept", std::string(rule.sentence)); break;
      case Verdict::broken: line("BROKEN", finding.text); break;
      case Verdict::passed_over: line("-", fmt::format("not examined: {}", finding.text)); break;
      case Verdict::unreached: line("-", "not reached"); break;
    }
  }
  return text + fmt::format("{} rules kept, {} broken, {} not examined (docs/protocol.md)\n", count(Verdict::kept), count(Verdict::broken),
                            count(Verdict::passed_over) + count(Verdict::unreached));
}

}  // namespace acopla::conformance
