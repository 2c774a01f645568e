// The common checkpoints of a run: everybody's state at one window's end.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "coupler/case.h"
#include "io/archive.h"

namespace acopla::coupler {

class Account;
class Crew;
class Scheme;

/// RESULTS/checkpoint holds the files of all participants and coupler.h5, of the last instant that all of them have written. The next one
/// is written beside it and takes its place at once, so that a run killed at any moment has one that is whole.
class Checkpoints {
 public:
  /// @param resumes  goes on from the checkpoint of `results`. @throws io::UserError when there is none, or it is of another case
  Checkpoints(const Case& read, const std::string& results, bool resumes);

  /// Ticks, and windows, that the run resumes after; 0 for a run from its beginning.
  std::int64_t windows() const { return windows_; }
  std::int64_t rows() const { return rows_; }
  /// Once the windows' length is known. @throws io::UserError when the checkpoint has another, or nothing is left to compute
  void check() const;
  /// Everybody returns to the checkpoint.
  void resume(Crew& crew, Account& account, Scheme& scheme);
  /// A scene that asks for none pays for none.
  bool due(std::int64_t windows) const { return case_.checkpoint_every > 0 && (windows % case_.checkpoint_every == 0 || windows == case_.windows); }
  /// Everybody must be idle, at the end of the account's last window.
  void write(Crew& crew, Account& account, Scheme& scheme);

 private:
  std::string folder() const { return results_ + "/checkpoint"; }

  const Case& case_;
  std::string results_;
  std::int64_t windows_ = 0, rows_ = 0;
  double time_ = 0;  // [s]
  io::State state_;
};

}  // namespace acopla::coupler
