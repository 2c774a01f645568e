// In which order the participants of a run compute, and what each is given.
#pragma once

#include "io/archive.h"

namespace acopla::coupler {

class Scheme {
 public:
  virtual ~Scheme() = default;
  /// Computes and closes the next window or some more, none beyond the next checkpoint, at which everybody is idle.
  /// @throws Failure, also for a ledger beyond its limit; Interrupted
  virtual void step() = 0;
  /// What it knows at a checkpoint.
  virtual void write(io::StateWriter& writer) = 0;
  virtual void read(io::StateReader& reader) = 0;
};

}  // namespace acopla::coupler
