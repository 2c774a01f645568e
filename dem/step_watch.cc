#include "dem/step_watch.h"

#include <fmt/format.h>

#include <stdexcept>

namespace acopla::dem {

void StepWatch::look(const Engine& engine, double step, std::uint64_t steps) {
  if (checked_at_ > 0 && steps < checked_at_ + 200) return;
  checked_at_ = steps;
  const auto found = engine.step_ratio(step);
  ratio_ = found.value;
  // A hard impact may pass the limit for some steps, in which nothing can grow; who is still beyond it two hundred steps later stays there.
  const bool again = beyond_;
  beyond_ = found.value > 1;
  if (!beyond_ || !again || allow_unstable_) return;
  const Vec3 x = engine.particles().position[found.particle].vector();
  throw std::runtime_error(fmt::format(
      "the step of {:.4g} s is unstable at t = {:.6g} s: it is {:.2f} of the limit of the contacts there are now, of which those of particle {} at "
      "({:.4g}, {:.4g}, {:.4g}) m are the stiffest. Lower {}, or say allow_unstable_step = true.",
      step, engine.time(), found.value, engine.particles().id[found.particle], x[0], x[1], x[2], knob_));
}

}  // namespace acopla::dem
