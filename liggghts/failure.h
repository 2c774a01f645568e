// LIGGGHTS's errors as exceptions with its own words, in place of an exit.
#pragma once

#include <stdexcept>

namespace acopla::liggghts {

class Failure : public std::runtime_error {
 public:
  Failure(const std::string& words, bool of_all) : std::runtime_error(words), of_all_(of_all) {}
  /// All processes threw it: nobody waits for anybody. Otherwise only this one did.
  bool of_all() const { return of_all_; }

 private:
  bool of_all_;
};

}  // namespace acopla::liggghts
