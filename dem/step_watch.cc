#include "dem/step_watch.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace acopla::dem {

void StepWatch::look(const Engine& engine, double step, std::uint64_t steps) {
  if (checked_at_ > 0 && steps < checked_at_ + pause_) return;
  checked_at_ = steps;
  const auto estimate = engine.stability(step);
  auto found = estimate.bound();
  const double bound = found.value;
  // The limit costs as much as some hundred steps of a large bed. The bed's limit follows the bound while that has not changed much.
  const bool serves = limit_bound_ > 0 && steps < limit_at_ + 20000 && std::abs(bound - limit_bound_) < 0.05 * limit_bound_;
  const auto find_limit = [&] {
    found = estimate.limit();
    limit_ = found.value;
    limit_bound_ = bound;
    limit_at_ = steps;
  };
  if (bound > 1 && !serves) find_limit();
  else if (bound > 1) found.value *= limit_ / limit_bound_;
  if (found.value > 1 && beyond_ && !allow_unstable_ && limit_at_ != steps) find_limit();  // before a run is stopped
  ratio_ = found.value;
  // A hard impact may pass the limit for some steps, in which nothing can grow; who is still beyond it two hundred steps later stays there.
  const bool again = beyond_;
  beyond_ = found.value > 1;
  pause_ = beyond_ ? 200 : std::min<std::uint64_t>(2 * pause_, 2000);
  if (!beyond_ || !again || allow_unstable_) return;
  const Vec3 x = engine.particles().position[found.particle].vector();
  throw std::runtime_error(fmt::format(
      "the step of {:.4g} s is unstable at t = {:.6g} s: it is {:.2f} of the limit of the contacts there are now, of which those of particle {} at "
      "({:.4g}, {:.4g}, {:.4g}) m are the stiffest. Lower {}, or say allow_unstable_step = true.",
      step, engine.time(), found.value, engine.particles().id[found.particle], x[0], x[1], x[2], knob_));
}

}  // namespace acopla::dem
