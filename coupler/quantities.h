// The scalar quantities that participants report, over time, and what the case expects of them.
#pragma once

#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "coupler/outcome.h"

namespace acopla::coupler {

class Quantities {
 public:
  /// Of what is expected all reports are kept, of the rest the last: a run of a million windows does not grow by them.
  explicit Quantities(const std::vector<Expectation>& expectations = {});
  /// @param name  "participant.quantity"; @param end  of the window it was reported for [s]
  void add(const std::string& name, double end, double value);

  /// The expectation against the last report not later than `at` or, with `mean_over`, the mean of
  /// all reports whose windows end within that time before `at`.
  Checked check(const Expectation& expectation) const;
  /// The last value of each, in the order of first report.
  std::vector<std::pair<std::string, double>> last() const;

  template <class Archive>
  void state(Archive& archive) {
    archive("order", order_);
    for (std::size_t k = 0; k < order_.size(); ++k) archive("reports" + std::to_string(k), reports_[order_[k]]);
  }

 private:
  std::map<std::string, std::vector<std::pair<double, double>>>
      reports_;  // end of window [s], value
  std::vector<std::string> order_;
  std::set<std::string> expected_;
};

}  // namespace acopla::coupler
