// The coupler's standard output: lines for a person, or lines of JSON for the launcher.
#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "coupler/reporter.h"

namespace acopla::coupler {

/// Plain lines.
class PlainAnnouncer final : public Reporter {
 public:
  void ready(const std::string& endpoint) override;
  void assembled(double seconds) override;
  void progress(std::int64_t window, std::int64_t windows, double time, double seconds) override;
  void note(const std::string& text) override;
  void done(const Outcome& outcome) override;
};

/// One JSON object a line, and a heartbeat every quarter second from a thread of its own, so that
/// the launcher sees a frozen coupler. Notes go to the standard error, which is the coupler's log.
class SupervisedAnnouncer final : public Reporter {
 public:
  SupervisedAnnouncer();
  ~SupervisedAnnouncer() override;
  SupervisedAnnouncer(const SupervisedAnnouncer&) = delete;
  SupervisedAnnouncer& operator=(const SupervisedAnnouncer&) = delete;

  void ready(const std::string& endpoint) override;
  void assembled(double seconds) override;
  void progress(std::int64_t window, std::int64_t windows, double time, double seconds) override;
  void note(const std::string& text) override;
  void done(const Outcome& outcome) override;

 private:
  void say(const std::string& line, bool must);
  void beat();
  std::mutex mutex_;
  std::condition_variable ending_;
  bool end_ = false;
  std::thread thread_;
};

}  // namespace acopla::coupler
