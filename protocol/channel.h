// A message over a ZeroMQ socket, and the solver's end of the connection.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <zmq.hpp>

#include "protocol/codec.h"
#include "protocol/keys.h"

namespace acopla::protocol {

/// @param has_keys  messages will be encrypted and both sides known to each other
/// @throws io::UserError for an address that is none, or a tcp address beyond loopback without keys
void check_endpoint(const std::string& endpoint, bool has_keys = false);

/// Sends a message, its arrays without a copy, or through `memory` where they are long. `identity` addresses a peer of a ROUTER; empty for other sockets.
/// @param memory  that the peer reads and has read what lay there; may be null
/// @return false when the peer is gone, or the socket's time for sending is over
bool send(zmq::socket_t& socket, const Message& message, const std::string& identity = {}, SharedMemory* memory = nullptr);

/// Frames of one message as they arrived, header first; the identity frame of a ROUTER is split off.
struct Parcel {
  std::string identity;
  std::vector<Frame> frames;
};
/// @return nothing when no message came within the time
std::optional<Parcel> receive_parcel(zmq::socket_t& socket, std::chrono::milliseconds wait, bool has_identity);

/// The solver's end: a DEALER.
class Channel {
 public:
  /// @param keys  of a participant, for tcp; may be null
  Channel(zmq::context_t& context, const std::string& endpoint, const Keys* keys = nullptr);
  /// @throws ProtocolError when no coupler takes it within two seconds
  void send(const Message& message);
  /// @throws ProtocolError when what came is not a message
  std::optional<Message> receive(std::chrono::milliseconds wait);
  /// From now on long arrays go through these. @return false when they cannot be seen from here
  bool use(const MemoryOffer& offer);

 private:
  zmq::socket_t socket_;
  MemoryPair memory_;
};

}  // namespace acopla::protocol
