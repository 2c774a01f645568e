// What a user sees of a run: the first line, progress, and a table at the end.
#pragma once

#include <chrono>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

namespace acopla::cli {

/// Progress: one line rewritten on a terminal, plain lines (every 2 s or 10 %, whichever is later)
/// elsewhere.
class Progress {
 public:
  Progress();
  void show(std::int64_t window, std::int64_t windows, double time, double seconds);
  /// Leaves the line, so that what follows starts on its own.
  void leave();

 private:
  bool terminal_;
  bool open_ = false;
  std::chrono::steady_clock::time_point last_shown_;
  double last_fraction_ = 0;
};

/// The table at the end. @param outcome  the coupler's last event (coupler/outcome.h); @param
/// start_up  seconds until the first window began; @param results  the folder
std::string final_table(const nlohmann::ordered_json& outcome, double start_up,
                        const std::string& results);

/// Path as short as it can be said from the present folder.
std::string shown_path(const std::string& path);

}  // namespace acopla::cli
