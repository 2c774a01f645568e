// The coupler's end of all connections: a ROUTER that knows its peers by number and never trusts what they send.
#pragma once

#include <chrono>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <zmq.hpp>

#include "protocol/keys.h"
#include "protocol/message.h"
#include "protocol/shared_memory.h"

namespace acopla::protocol {

/// Something that arrived: a message, or the reason why it was none.
struct Arrival {
  std::string peer;                ///< address for send()
  std::optional<Message> message;  ///< empty when what came was not a message
  std::string fault;               ///< why not
};

class Hub {
 public:
  /// Binds. @throws io::UserError when the address is in use or not allowed
  /// @param keys  of a coupler, for tcp; may be null
  Hub(zmq::context_t& context, const std::string& endpoint, const Keys* keys = nullptr);
  const std::string& endpoint() const { return endpoint_; }  ///< with the port the system chose for tcp://…:0

  std::optional<Arrival> receive(std::chrono::milliseconds wait);
  /// @return false when the peer is gone
  bool send(const std::string& peer, const Message& message);
  /// Memory to share with a peer of this machine, that is over ipc; its answers may lie in it at once. Nothing where there is none.
  std::optional<MemoryOffer> offer_memory(const std::string& peer);
  /// The peer has found it: requests may lie in it, too.
  void use_memory(const std::string& peer);
  /// For a poll together with other descriptors.
  zmq::socket_t& socket() { return socket_; }

 private:
  std::unique_ptr<Gate> gate_;  // before the socket that asks it
  zmq::socket_t socket_;
  std::string endpoint_;
  struct Shared {
    MemoryPair memory;
    bool found = false;  // by the peer
  };
  std::map<std::string, Shared> shared_;  // by peer
};

/// Binds a socket and says so in a sentence when it cannot.
std::string bind_or_explain(zmq::socket_t& socket, const std::string& endpoint);

}  // namespace acopla::protocol
