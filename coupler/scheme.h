// In which order the participants of a run compute, and what each is given.
#pragma once

namespace acopla::coupler {

class Scheme {
 public:
  virtual ~Scheme() = default;
  /// Computes all windows. @throws Failure, also for a ledger beyond its limit; Interrupted
  virtual void run() = 0;
};

}  // namespace acopla::coupler
