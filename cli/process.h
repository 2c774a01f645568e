// A process that the launcher started and answers for.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace acopla::cli {

struct Command {
  std::vector<std::string> words;                                ///< program and arguments
  std::vector<std::pair<std::string, std::string>> environment;  ///< added to ours
  std::string folder;  ///< to run in; empty: the present one
};

/// The path of a program: as written where it holds a slash (relative to `folder`), else searched
/// for in PATH. Empty when there is none that may be executed.
std::string find_program(const std::string& word, const std::string& folder);
/// The folder of the running executable, where acopla-coupler and the solvers stand.
std::string own_folder();

/// "was killed by signal 9 (Killed)", "ended with exit code 1"
std::string describe_exit(int wait_status);
/// The last lines of a text file that are not empty, oldest first.
std::vector<std::string> last_lines(const std::string& path, std::size_t count);

/// Runs a command with our own standard streams and waits for it. @return its exit code; 1 when a
/// signal killed it
int run_and_wait(const Command& command);

/// A child in a process group of its own that dies with the launcher, whatever kills the launcher.
class Child {
 public:
  struct Streams {
    std::string
        log;  ///< file that standard error, and output where it goes nowhere else, are written to
    int input = -1;   ///< descriptor for the standard input; −1: nothing
    int output = -1;  ///< descriptor for the standard output; −1: the log
  };
  /// @throws io::UserError when the program cannot be started
  Child(std::string name, std::string program, const Command& command, const Streams& streams);

  const std::string& name() const { return name_; }
  const std::string& program() const { return program_; }
  const std::string& log() const { return log_; }
  pid_t pid() const { return pid_; }
  bool running() const { return running_; }
  int status() const { return status_; }

  /// Looks, without waiting, what became of it. @return true when it ended just now
  bool look();
  /// For how long it has been stopped (SIGSTOP), if it is.
  std::optional<std::chrono::milliseconds> stopped_for() const;
  /// Ends it and everything it started, at once.
  void kill_group() const;

 private:
  std::string name_, program_, log_;
  pid_t pid_ = -1;
  bool running_ = true;
  int status_ = 0;
  std::optional<std::chrono::steady_clock::time_point> stopped_;
};

}  // namespace acopla::cli
