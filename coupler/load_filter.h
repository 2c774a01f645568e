// What receivers of a one-way coupling are given of the forces of many windows.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <utility>

#include "coupler/account.h"
#include "coupler/case.h"
#include "io/archive.h"

namespace acopla::coupler {

/// Spans of windows, each of which makes one load:
///
/// - history: every window from loads_from on, with its own mean force;
/// - running_mean: the same windows, each with the mean over the last `over` (what there is of it at the start);
/// - mean: one span [at − over, at], with the mean over it;
/// - snapshot: one span, the last window before `at`;
/// - peak: one span [at − over, at]; every node has the force of that window in which it was largest there, an envelope of no one instant.
class LoadFilter {
 public:
  using Forces = Account::Forces;
  explicit LoadFilter(const Case& read) : case_(read) {}

  std::int64_t spans() const;
  std::pair<std::int64_t, std::int64_t> span(std::int64_t index) const;  ///< first window and one past the last
  std::int64_t span_of(std::int64_t window) const;                       ///< −1 where receivers get nothing of it
  /// The forces of all senders in a window, window by window from the first. A node that is not loaded has a force of zero.
  void take(std::int64_t window, Forces forces);
  /// The load of a span that is complete, until it is dropped.
  const Forces& load(std::int64_t index) const { return loads_.at(index); }
  void drop(std::int64_t index) { loads_.erase(index); }

  /// Of a load that is begun, and of the windows that a running mean needs.
  void write(io::StateWriter& writer) const;
  void read(io::StateReader& reader);

 private:
  bool by_window() const { return case_.loads == Loads::history || case_.loads == Loads::running_mean; }

  const Case& case_;
  std::map<std::int64_t, Forces> loads_;  // by span
  std::deque<Forces> recent_;             // running mean: the last windows, the newest at the end
};

}  // namespace acopla::coupler
