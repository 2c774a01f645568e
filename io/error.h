// A user's mistake: one located sentence with the fix, exit code 2. A bug is an assertion instead.
#pragma once

#include <stdexcept>
#include <string>

namespace acopla::io {

/// Exit codes of every executable (docs/guide.md). 3 is an expectation or a ledger limit that failed.
enum ExitCode : int { exit_done = 0, exit_failure = 1, exit_user_error = 2, exit_missed = 3, exit_interrupted = 130 };

/// Where in a case file something was written. Line and column count from 1; 0 when unknown.
struct Location {
  std::string file;
  int line = 0;
  int column = 0;
  std::string text() const;  ///< "case.toml:31:12", or the file alone
};

/// What the user wrote cannot be done. `what()` is "file:line:column: sentence with the fix".
class UserError : public std::runtime_error {
 public:
  explicit UserError(const std::string& sentence) : std::runtime_error(sentence) {}
  UserError(const Location& where, const std::string& sentence)
      : std::runtime_error(where.file.empty() ? sentence : where.text() + ": " + sentence) {}
};

}  // namespace acopla::io
