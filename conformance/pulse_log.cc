#include "conformance/pulse_log.h"

#include <algorithm>

#include "protocol/channel.h"
#include "protocol/codec.h"
#include "protocol/hub.h"
#include "protocol/pulse.h"

namespace acopla::conformance {

PulseLog::PulseLog(zmq::context_t& context, const std::string& endpoint, bool pings)
    : socket_(context, zmq::socket_type::router), pings_(pings) {
  socket_.set(zmq::sockopt::linger, 0);
  endpoint_ = protocol::bind_or_explain(socket_, endpoint);
  thread_ = std::thread([this] { run(); });
}

PulseLog::~PulseLog() {
  stop_ = true;
  thread_.join();
}

std::optional<std::string> PulseLog::reported() const {
  const std::lock_guard lock(mutex_);
  return peer_.empty() ? std::nullopt : std::optional(name_);
}

std::string PulseLog::fault() const {
  const std::lock_guard lock(mutex_);
  return fault_;
}

void PulseLog::mark() {
  const std::lock_guard lock(mutex_);
  last_ = Clock::now();
  longest_ = {};
}

std::chrono::milliseconds PulseLog::longest_silence() const {
  const std::lock_guard lock(mutex_);
  return std::chrono::duration_cast<std::chrono::milliseconds>(std::max(longest_, Clock::now() - last_));
}

void PulseLog::run() {
  auto next_ping = Clock::now(), last_turn = next_ping;
  protocol::Message ping;
  ping.kind = protocol::Kind::ping;
  while (!stop_) {
    hear(std::chrono::milliseconds(20));
    // A gap of its own this long means that this process was stopped or starved: the participant is not to blame for it.
    const auto turn = Clock::now();
    if (turn - last_turn > std::chrono::milliseconds(750)) mark();
    last_turn = turn;
    if (!pings_ || peer_.empty() || Clock::now() < next_ping) continue;
    protocol::send(socket_, ping, peer_);
    next_ping = Clock::now() + protocol::ping_interval;
  }
}

void PulseLog::hear(std::chrono::milliseconds wait) {
  const auto parcel = protocol::receive_parcel(socket_, wait, true);
  if (!parcel) return;
  const std::lock_guard lock(mutex_);
  try {
    const auto message = protocol::decode(parcel->frames);
    if (message.kind != protocol::Kind::pong) {
      fault_ = "sent " + std::string(protocol::name_of(message.kind)) + " to the pulse";
      return;
    }
    const auto name = message.body.find("participant");
    if (name == message.body.end() || !name->is_string()) {
      fault_ = "sent a pong without \"participant\"";
      return;
    }
    peer_ = parcel->identity;
    name_ = name->get<std::string>();
    longest_ = std::max(longest_, Clock::now() - last_);
    last_ = Clock::now();
  } catch (const protocol::ProtocolError& error) {
    fault_ = std::string("sent something to the pulse that is not the protocol: ") + error.what();
  }
}

}  // namespace acopla::conformance
