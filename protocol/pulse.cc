#include "protocol/pulse.h"

#include <algorithm>

#include "protocol/channel.h"
#include "protocol/hub.h"

namespace acopla::protocol {
namespace {

using Clock = std::chrono::steady_clock;
constexpr std::chrono::milliseconds poll_interval{50};
// A gap of its own this long means that this very process was stopped or starved: nobody else is to blame for it.
constexpr std::chrono::milliseconds own_gap{750};

Message pulse_message(Kind kind, const std::string& participant) {
  Message message;
  message.kind = kind;
  if (!participant.empty()) message.body["participant"] = participant;
  return message;
}

}  // namespace

PulseMonitor::PulseMonitor(zmq::context_t& context, const std::string& endpoint, const Keys* keys)
    : socket_(context, zmq::socket_type::router), last_turn_(Clock::now()) {
  socket_.set(zmq::sockopt::linger, 0);
  socket_.set(zmq::sockopt::maxmsgsize, std::int64_t{1} << 16);  // a pong is a hundred bytes
  if (keys) use_as_coupler(socket_, endpoint, *keys);
  endpoint_ = bind_or_explain(socket_, endpoint);
  thread_ = std::thread([this] { run(); });
}

PulseMonitor::~PulseMonitor() {
  stop_ = true;
  thread_.join();
}

std::optional<std::string> PulseMonitor::frozen() const {
  if (Clock::now() - last_turn_.load() > own_gap) return std::nullopt;  // this process itself was stopped
  const std::lock_guard lock(mutex_);
  for (const auto& [participant, last] : last_pong_)
    if (Clock::now() - last > ping_limit) return participant;
  return std::nullopt;
}

void PulseMonitor::expect(const std::string& participant) {
  const std::lock_guard lock(mutex_);
  last_pong_[participant] = Clock::now() + (report_limit - ping_limit);
}

void PulseMonitor::forget(const std::string& participant) {
  const std::lock_guard lock(mutex_);
  last_pong_[participant] = Clock::time_point::max();  // a late pong must not bring it back
}

void PulseMonitor::run() {
  std::map<std::string, std::string> peers;  // address → participant
  const Message ping = pulse_message(Kind::ping, {});
  auto next_ping = Clock::now();
  while (!stop_) {
    if (auto parcel = receive_parcel(socket_, poll_interval, true)) {
      try {
        const auto message = decode(parcel->frames);
        if (message.kind == Kind::pong && message.body.contains("participant") && message.body["participant"].is_string()) {
          const auto participant = message.body["participant"].get<std::string>();
          const std::lock_guard lock(mutex_);
          if (const auto known = last_pong_.find(participant); known != last_pong_.end()) {
            peers[parcel->identity] = participant;
            if (known->second != Clock::time_point::max()) known->second = Clock::now();
          }
        }
      } catch (const ProtocolError&) {  // a stranger on the port has no pulse
      }
    }
    const auto now = Clock::now();
    if (now - last_turn_.load() > own_gap) {
      const std::lock_guard lock(mutex_);
      for (auto& [participant, last] : last_pong_)
        if (last != Clock::time_point::max()) last = std::max(last, now);
    }
    last_turn_ = now;
    if (now >= next_ping) {
      for (const auto& [peer, participant] : peers) send(socket_, ping, peer);
      next_ping = now + ping_interval;
    }
  }
}

Pulse::Pulse(zmq::context_t& context, const std::string& endpoint, std::string participant, const Keys* keys)
    : socket_(context, zmq::socket_type::dealer), participant_(std::move(participant)), last_ping_(Clock::now()) {
  socket_.set(zmq::sockopt::linger, 0);
  socket_.set(zmq::sockopt::sndtimeo, 0);  // without a coupler a send would wait for ever, and with it our end
  if (keys) use_as_participant(socket_, endpoint, *keys);
  socket_.connect(endpoint);
  thread_ = std::thread([this] { run(); });
}

Pulse::~Pulse() {
  stop_ = true;
  thread_.join();
}

std::chrono::milliseconds Pulse::silence() const {
  return std::chrono::duration_cast<std::chrono::milliseconds>(Clock::now() - last_ping_.load());
}

void Pulse::run() {
  const Message pong = pulse_message(Kind::pong, participant_);
  send(socket_, pong);  // reports, so that the coupler starts to ping
  auto last_turn = Clock::now();
  while (!stop_) {
    if (receive_parcel(socket_, poll_interval, false)) {
      last_ping_ = Clock::now();
      send(socket_, pong);
    }
    if (Clock::now() - last_turn > own_gap) last_ping_ = Clock::now();
    last_turn = Clock::now();
  }
}

}  // namespace acopla::protocol
