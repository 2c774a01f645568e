// How many ticks the next window takes, where the case leaves that to the program.
#pragma once

#include <cstdint>

#include "coupler/case.h"
#include "coupler/stability.h"

namespace acopla::coupler {

/// window = "auto": the longest windows in which the explicit scheme is stable and accurate beside the contacts there are, a power of two ticks up
/// to WindowInSteps::longest. They begin with one, and become twice as long at most from one to the next, where the ticks so far are a multiple of the new
/// length; so few lengths occur, each of which a structure factors once. A contact that stiffens shortens them at once.
class WindowSpan {
 public:
  explicit WindowSpan(const Case& read) : case_(read) {}

  std::int64_t ticks() const { return ticks_; }
  double length() const { return static_cast<double>(ticks_) * case_.window; }  ///< [s]
  /// The contacts are so soft beside the window, or there are none, that a new one may be too stiff for it: a wise caller keeps the state before.
  bool exposed() const { return case_.in_steps.automatic && ticks_ > 1 && ratio_ < exposed_below; }
  /// The window just computed was too long for what it met. @param forces  went through contacts; @param stability  after it
  bool too_long(const Stability& stability, bool forces) const;
  /// A shorter one in its place.
  void shorten(const Stability& stability, bool forces);
  /// The next window's, from tick `start` on.
  void go_on(const Stability& stability, std::int64_t start);

  template <class Archive>
  void state(Archive& archive) {
    archive("ticks", ticks_);
    archive("ratio", ratio_);
  }

 private:
  // Of the root of (k Δt² + 2 c Δt)/M: from 0.5 on the scheme would be noted as losing accuracy.
  static constexpr double most_ratio = 0.5, exposed_below = 0.25;
  // Of the motion in a window, undone by any contact that damps: a hundred windows in contact treble it.
  static constexpr double most_growth = 0.01;

  bool suits(const Stability& stability, std::int64_t ticks) const;

  const Case& case_;
  std::int64_t ticks_ = 1;
  double ratio_ = 0;  // of the present length, by the contacts at its start
};

}  // namespace acopla::coupler
