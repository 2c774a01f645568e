// CURVE keys (ZeroMQ's elliptic-curve encryption and authentication), without which tcp stays on loopback.
#pragma once

#include <atomic>
#include <string>
#include <thread>
#include <zmq.hpp>

namespace acopla::protocol {

/// One side's pair and the public key of the other side, in Z85.
struct Keys {
  std::string own_public, own_secret, other_public;
};

/// Makes a folder with coupler.keys and participant.keys, which only this user may read. Participants share one pair: who has it may take part.
/// @throws io::UserError when there are keys already, or the folder cannot be written
void make_keys(const std::string& folder);
/// @throws io::UserError, with the file, when it is missing, is not a key file, or others may read it
Keys read_coupler_keys(const std::string& folder);
Keys read_participant_keys(const std::string& folder);
/// The folder in ACOPLA_KEYS; empty where that is not set.
std::string keys_of_environment();

/// Before bind() and connect(); without effect but for tcp.
void use_as_coupler(zmq::socket_t& socket, const std::string& endpoint, const Keys& keys);
void use_as_participant(zmq::socket_t& socket, const std::string& endpoint, const Keys& keys);

/// Answers ZeroMQ's question whether a peer's key is that of the participants (ZAP, rfc.zeromq.org/spec/27), for all sockets of a context.
/// A peer without it never gets as far as a message.
class Gate {
 public:
  Gate(zmq::context_t& context, const Keys& keys);
  ~Gate();
  Gate(const Gate&) = delete;
  Gate& operator=(const Gate&) = delete;

 private:
  void run();
  zmq::socket_t socket_;
  std::string allowed_;  // 32 bytes
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace acopla::protocol
