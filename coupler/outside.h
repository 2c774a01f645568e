// What reaches the coupler from outside the protocol: signals, and the notices of the launcher that
// started everybody.
#pragma once

#include <string>
#include <vector>

namespace acopla::coupler {

/// Something the launcher or the system tells.
struct Notice {
  enum class Kind { exited, stopped, interrupt } kind = Kind::interrupt;
  std::string participant;
  std::string how;         ///< "was killed by signal 9 (Killed)"
  bool mistake = false;    ///< it ended with the exit code of a user's mistake
  std::string last_words;  ///< the end of its log
};

class Outside {
 public:
  virtual ~Outside() = default;
  /// Descriptors that become readable when read() has something to give.
  virtual std::vector<int> descriptors() const { return {}; }
  virtual std::vector<Notice> read() { return {}; }
};

/// SIGINT and SIGTERM of this process and, under a launcher, its notices as lines of JSON on the
/// standard input, whose end means that the launcher is gone. Construct it before any thread: it
/// blocks the signals for all of them.
class ProcessOutside final : public Outside {
 public:
  explicit ProcessOutside(bool supervised);
  ~ProcessOutside() override;
  ProcessOutside(const ProcessOutside&) = delete;
  ProcessOutside& operator=(const ProcessOutside&) = delete;
  std::vector<int> descriptors() const override;
  std::vector<Notice> read() override;

 private:
  void read_signals(std::vector<Notice>& notices);
  void read_launcher(std::vector<Notice>& notices);
  int signals_ = -1;
  bool listens_ = false;  // to the launcher
  std::string unfinished_;
};

/// A notice as the line that the launcher writes, and back. @throws std::exception for a line that
/// is none
std::string to_line(const Notice& notice);
Notice notice_from_line(const std::string& line);

}  // namespace acopla::coupler
