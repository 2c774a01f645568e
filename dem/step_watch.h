// Looks now and then whether the step is still below the stability limit of the contacts there are.
#pragma once

#include <cstdint>

#include "dem/engine.h"

namespace acopla::dem {

class StepWatch {
 public:
  explicit StepWatch(const Scene& scene) : knob_(scene.step ? "step" : "step_fraction"), allow_unstable_(scene.allow_unstable_step) {}
  /// To be called between windows. The bound takes as long as some steps: it is looked at when first called and then after 200 steps,
  /// 400 and so on up to 2000; after 200 where it was beyond the limit.
  /// @param steps  made since the start
  /// @throws std::runtime_error  that says when, where and by how much the step was too long twice in a row
  void look(const Engine& engine, double step, std::uint64_t steps);
  /// Of the last look: the step over the limit, or over a safe bound of it; 0 without contacts.
  double ratio() const { return ratio_; }

  template <class Archive>
  void state(Archive& archive) {
    archive("checked_at", checked_at_);
    archive("ratio", ratio_);
    archive("pause", pause_);
    archive("beyond", beyond_);
    archive("limit", limit_);
    archive("limit_bound", limit_bound_);
    archive("limit_at", limit_at_);
  }

 private:
  const char* knob_;
  bool allow_unstable_;
  std::uint64_t checked_at_ = 0, pause_ = 100;
  double ratio_ = 0;
  bool beyond_ = false;
  double limit_ = 0, limit_bound_ = 0;  // the last limit, and the bound of that time
  std::uint64_t limit_at_ = 0;
};

}  // namespace acopla::dem
