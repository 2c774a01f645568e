#include "coupler/quantities.h"

#include <cmath>

namespace acopla::coupler {

Quantities::Quantities(const std::vector<Expectation>& expectations) {
  for (const auto& expectation : expectations) expected_.insert(expectation.name);
}

void Quantities::add(const std::string& name, double end, double value) {
  auto& reports = reports_[name];
  if (reports.empty()) order_.push_back(name);
  else if (!expected_.count(name)) reports.clear();
  reports.emplace_back(end, value);
}

Checked Quantities::check(const Expectation& expectation) const {
  Checked checked{expectation, std::nullopt, 0, false};
  const auto found = reports_.find(expectation.name);
  if (found == reports_.end()) return checked;
  const double slack = 1e-9 * expectation.at;
  double sum = 0;
  std::size_t count = 0;
  for (const auto& [end, value] : found->second) {
    if (end > expectation.at + slack) break;
    if (expectation.mean_over == 0) {
      sum = value;
      count = 1;
    } else if (end > expectation.at - expectation.mean_over + slack) {
      sum += value;
      ++count;
    }
  }
  if (count == 0) return checked;
  checked.value = sum / static_cast<double>(count);
  checked.error = std::abs(*checked.value - expectation.value);
  if (expectation.relative) checked.error /= std::abs(expectation.value);
  checked.met = checked.error <= expectation.tolerance;  // false for NaN
  return checked;
}

std::vector<std::pair<std::string, double>> Quantities::last() const {
  std::vector<std::pair<std::string, double>> values;
  for (const auto& name : order_) values.emplace_back(name, reports_.at(name).back().second);
  return values;
}

}  // namespace acopla::coupler
