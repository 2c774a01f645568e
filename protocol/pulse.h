// The pulse: pings on threads and sockets of their own, so that a long computation is not taken for death and a frozen
// process is seen within two seconds.
#pragma once

#include <atomic>
#include <chrono>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <zmq.hpp>

#include "protocol/keys.h"

namespace acopla::protocol {

inline constexpr std::chrono::milliseconds ping_interval{250};
inline constexpr std::chrono::milliseconds ping_limit{1500};  ///< silence after which a process counts as frozen
inline constexpr std::chrono::milliseconds report_limit{10000};  ///< from the welcome to the first pong

/// The coupler's side: pings everybody who reported, and tells who fell silent.
class PulseMonitor {
 public:
  /// @param endpoint  to bind, e.g. the hub's with ".pulse", or tcp://127.0.0.1:* for any port
  /// @param keys  of a coupler, for tcp, whose Hub stands at the gate; may be null
  PulseMonitor(zmq::context_t& context, const std::string& endpoint, const Keys* keys = nullptr);
  ~PulseMonitor();
  PulseMonitor(const PulseMonitor&) = delete;
  PulseMonitor& operator=(const PulseMonitor&) = delete;

  const std::string& endpoint() const { return endpoint_; }
  /// The participant was told this address and will report. Pongs in any other name are ignored: a stranger has no pulse.
  void expect(const std::string& participant);
  /// A participant that has not answered for `ping_limit`, or never reported within `report_limit`.
  std::optional<std::string> frozen() const;
  /// The participant is about to end and need not answer any more.
  void forget(const std::string& participant);

 private:
  void run();
  zmq::socket_t socket_;
  std::string endpoint_;
  mutable std::mutex mutex_;
  std::map<std::string, std::chrono::steady_clock::time_point> last_pong_;
  std::atomic<std::chrono::steady_clock::time_point> last_turn_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

/// The solver's side: answers pings, and knows for how long none came.
class Pulse {
 public:
  /// @param keys  of a participant, for tcp; may be null
  Pulse(zmq::context_t& context, const std::string& endpoint, std::string participant, const Keys* keys = nullptr);
  ~Pulse();
  Pulse(const Pulse&) = delete;
  Pulse& operator=(const Pulse&) = delete;

  /// Time since the coupler's last ping.
  std::chrono::milliseconds silence() const;

 private:
  void run();
  zmq::socket_t socket_;
  std::string participant_;
  std::atomic<std::chrono::steady_clock::time_point> last_ping_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace acopla::protocol
