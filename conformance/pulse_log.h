// The coupler's pulse, with a record of how it was answered.
#pragma once

#include <atomic>
#include <chrono>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <zmq.hpp>

namespace acopla::conformance {

class PulseLog {
 public:
  using Clock = std::chrono::steady_clock;
  /// @param pings  false: hears what reports, and never pings
  PulseLog(zmq::context_t& context, const std::string& endpoint, bool pings);
  ~PulseLog();
  PulseLog(const PulseLog&) = delete;
  PulseLog& operator=(const PulseLog&) = delete;

  const std::string& endpoint() const { return endpoint_; }
  /// The name in the first pong; nothing before it came.
  std::optional<std::string> reported() const;
  /// What came that was no pong, if anything did.
  std::string fault() const;
  /// Starts to measure anew.
  void mark();
  /// The longest time without a pong since mark(), up to now.
  std::chrono::milliseconds longest_silence() const;

 private:
  void run();
  void hear(std::chrono::milliseconds wait);
  zmq::socket_t socket_;
  std::string endpoint_;
  bool pings_;
  mutable std::mutex mutex_;
  std::string peer_, name_, fault_;
  Clock::time_point last_ = Clock::now();
  Clock::duration longest_{};
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace acopla::conformance
