// What a run needs beside its results: a private folder for its sockets, and somebody who cleans up
// after a launcher that was killed.
#pragma once

#include <sys/types.h>

#include <string>

namespace acopla::cli {

/// A folder /tmp/acopla-PID-XXXXXX that only we may enter; removed at the end. Making it removes
/// those of dead launchers.
class Workplace {
 public:
  Workplace();
  ~Workplace();
  Workplace(const Workplace&) = delete;
  Workplace& operator=(const Workplace&) = delete;
  std::string endpoint() const { return "ipc://" + folder_ + "/hub"; }
  const std::string& folder() const { return folder_; }

 private:
  std::string folder_;
};

/// A small process that outlives a launcher killed without warning, and then ends whatever the
/// launcher had started, grandchildren too. Make it before anything else is opened or started.
class Guard {
 public:
  Guard();
  ~Guard();
  Guard(const Guard&) = delete;
  Guard& operator=(const Guard&) = delete;
  void watch_group(pid_t group);
  void forget_group(pid_t group);
  void watch_folder(const std::string& folder);

 private:
  void tell(const std::string& line) const;
  int pipe_ = -1;
  pid_t pid_ = -1;
};

}  // namespace acopla::cli
