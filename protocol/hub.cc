#include "protocol/hub.h"

#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>

#include "io/error.h"
#include "protocol/channel.h"

namespace acopla::protocol {
namespace {

// ZeroMQ takes over an ipc path that another live process listens on, so it is asked first whether somebody answers.
bool somebody_listens(const std::string& path) {
  const int descriptor = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (descriptor < 0) return false;
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
  const bool answered = ::connect(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  ::close(descriptor);
  return answered;
}

}  // namespace

std::string bind_or_explain(zmq::socket_t& socket, const std::string& endpoint) {
  const bool is_ipc = endpoint.starts_with("ipc://");
  if (is_ipc && std::filesystem::exists(endpoint.substr(6)) && somebody_listens(endpoint.substr(6)))
    throw io::UserError(fmt::format("{} is in use by another coupler. Stop it, or choose another address.", endpoint));
  try {
    socket.bind(endpoint);
  } catch (const zmq::error_t& error) {
    if (error.num() == EADDRINUSE)
      throw io::UserError(fmt::format("{} is in use. Stop the process that holds it, or choose another port.", endpoint));
    throw io::UserError(fmt::format("{} cannot be opened: {}. Check the address and the folder's permissions.", endpoint,
                                    error.what()));
  }
  return socket.get(zmq::sockopt::last_endpoint);
}

Hub::Hub(zmq::context_t& context, const std::string& endpoint, const Keys* keys)
    : gate_(keys ? std::make_unique<Gate>(context, *keys) : nullptr), socket_(context, zmq::socket_type::router) {
  check_endpoint(endpoint, keys);
  if (keys) use_as_coupler(socket_, endpoint, *keys);
  socket_.set(zmq::sockopt::linger, 1000);
  socket_.set(zmq::sockopt::router_mandatory, true);  // a peer that is gone is an answer, not silence
  socket_.set(zmq::sockopt::sndhwm, 0);
  socket_.set(zmq::sockopt::rcvhwm, 0);
  socket_.set(zmq::sockopt::maxmsgsize, std::int64_t{1} << 33);
  endpoint_ = bind_or_explain(socket_, endpoint);
}

std::optional<Arrival> Hub::receive(std::chrono::milliseconds wait) {
  auto parcel = receive_parcel(socket_, wait, true);
  if (!parcel) return std::nullopt;
  Arrival arrival{std::move(parcel->identity), std::nullopt, {}};
  try {
    const auto shared = shared_.find(arrival.peer);
    arrival.message = decode(parcel->frames, {}, shared == shared_.end() ? nullptr : shared->second.memory.answers.get());
  } catch (const ProtocolError& error) {
    arrival.fault = error.what();
  }
  return arrival;
}

bool Hub::send(const std::string& peer, const Message& message) {
  const auto shared = shared_.find(peer);
  return protocol::send(socket_, message, peer, shared != shared_.end() && shared->second.found ? shared->second.memory.requests.get() : nullptr);
}

std::optional<MemoryOffer> Hub::offer_memory(const std::string& peer) {
  if (!endpoint_.starts_with("ipc://")) return std::nullopt;
  auto memory = MemoryPair::create();
  if (!memory.is_there()) return std::nullopt;
  auto offer = memory.offer();
  shared_[peer] = {std::move(memory), false};
  return offer;
}

void Hub::use_memory(const std::string& peer) {
  if (const auto shared = shared_.find(peer); shared != shared_.end()) shared->second.found = true;
}

}  // namespace acopla::protocol
