#include "coupler/window_span.h"

#include <algorithm>

namespace acopla::coupler {

bool WindowSpan::suits(const Stability& stability, std::int64_t ticks) const {
  const auto worst = stability.worst(static_cast<double>(ticks) * case_.window);
  return worst.ratio <= most_ratio && worst.growth <= most_growth;
}

bool WindowSpan::too_long(const Stability& stability, bool forces) const {
  if (!case_.in_steps.automatic || ticks_ == 1) return false;
  // Forces that no contact explains: one began and ended inside.
  return !suits(stability, ticks_) || (forces && !stability.held());
}

void WindowSpan::shorten(const Stability& stability, bool forces) {
  do ticks_ /= 2;
  while (ticks_ > 1 && !suits(stability, ticks_));
  // What passed unseen says nothing of how long is short enough.
  if (forces && !stability.held()) ticks_ = std::max<std::int64_t>(1, ticks_ / 2);
  ratio_ = stability.worst(length()).ratio;
}

void WindowSpan::go_on(const Stability& stability, std::int64_t start) {
  if (!case_.in_steps.automatic) return;
  const auto twice = 2 * ticks_;
  if (twice <= WindowInSteps::longest && start % twice == 0 && suits(stability, twice)) ticks_ = twice;
  while (ticks_ > 1 && !suits(stability, ticks_)) ticks_ /= 2;
  ratio_ = stability.worst(length()).ratio;
}

}  // namespace acopla::coupler
