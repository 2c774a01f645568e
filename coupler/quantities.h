// The scalar quantities that participants report, over time, and what the case expects of them.
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "coupler/outcome.h"

namespace acopla::coupler {

class Quantities {
 public:
  /// @param name  "participant.quantity"; @param end  of the window it was reported for [s]
  void add(const std::string& name, double end, double value);

  /// The expectation against the last report not later than `at` or, with `mean_over`, the mean of
  /// all reports whose windows end within that time before `at`.
  Checked check(const Expectation& expectation) const;
  /// The last value of each, in the order of first report.
  std::vector<std::pair<std::string, double>> last() const;

 private:
  std::map<std::string, std::vector<std::pair<double, double>>>
      reports_;  // end of window [s], value
  std::vector<std::string> order_;
};

}  // namespace acopla::coupler
