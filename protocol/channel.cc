#include "protocol/channel.h"

#include <fmt/format.h>

#include <cstring>

#include "io/error.h"

#ifdef __SANITIZE_THREAD__
#include <sanitizer/tsan_interface.h>
#endif

namespace acopla::protocol {
namespace {

// Debian's libzmq is not instrumented, so the thread sanitizer must be told that what one thread wrote into a message
// before sending it is there for the thread that received it. Nothing at all in other builds.
#ifdef __SANITIZE_THREAD__
char handover;  // only its address is used
void hand_over() { __tsan_release(&handover); }
void take_over() { __tsan_acquire(&handover); }
#else
void hand_over() {}
void take_over() {}
#endif

/// Of a message with less ZeroMQ copies the frames into one batch, which is as fast [bytes].
constexpr std::size_t worth_sharing = 8 << 10;
/// Where arrays begin in shared memory: at a cache line.
constexpr std::size_t line = 64;

/// Copies long arrays into shared memory. @return where each lies; nothing when they are to be sent as frames
std::vector<std::uint64_t> lay(const Message& message, SharedMemory* memory) {
  std::vector<std::uint64_t> offsets;
  std::size_t end = 0;
  for (const auto& array : message.arrays) {
    offsets.push_back(SharedMemory::arrays_begin + end);
    end += (array.bytes().size() + line - 1) / line * line;
  }
  auto* const room = memory && end >= worth_sharing ? memory->room(end) : nullptr;
  if (!room) return {};
  for (std::size_t k = 0; k < offsets.size(); ++k)
    if (const auto bytes = message.arrays[k].bytes(); !bytes.empty())
      std::memcpy(room + (offsets[k] - SharedMemory::arrays_begin), bytes.data(), bytes.size());
  return offsets;
}

}  // namespace

void check_endpoint(const std::string& endpoint, bool has_keys) {
  if (endpoint.starts_with("ipc://") || endpoint.starts_with("inproc://")) {
    constexpr std::size_t longest = 107;  // sockaddr_un
    if (endpoint.starts_with("ipc://") && endpoint.size() - 6 > longest)
      throw io::UserError(fmt::format("{}: a socket's path may have {} characters. Choose a shorter folder.", endpoint, longest));
    return;
  }
  if (!endpoint.starts_with("tcp://"))
    throw io::UserError(fmt::format("{}: not an endpoint. Use ipc:///PATH or tcp://127.0.0.1:PORT.", endpoint));
  if (has_keys) return;
  const auto host = endpoint.substr(6, endpoint.rfind(':') - 6);
  if (host != "127.0.0.1" && host != "localhost" && host != "[::1]")
    throw io::UserError(fmt::format("{}: tcp is open to loopback only, because messages are neither signed nor "
                                    "encrypted without keys. Use tcp://127.0.0.1:PORT, or make keys by `acopla keys DIR` and give them to "
                                    "both sides with --keys DIR.", endpoint));
}

bool send(zmq::socket_t& socket, const Message& message, const std::string& identity, SharedMemory* memory) {
  hand_over();
  try {
    if (!identity.empty() && !socket.send(zmq::buffer(identity), zmq::send_flags::sndmore)) return false;
    if (const auto offsets = lay(message, memory); !offsets.empty())
      return socket.send(zmq::buffer(encode_header(message, offsets)), zmq::send_flags::none).has_value();
    const auto header = encode_header(message);
    const auto more = [](bool yes) { return yes ? zmq::send_flags::sndmore : zmq::send_flags::none; };
    if (!socket.send(zmq::buffer(header), more(!message.arrays.empty()))) return false;  // timed out
    for (std::size_t k = 0; k < message.arrays.size(); ++k) {
      const auto& array = message.arrays[k];
      // ZeroMQ frees the frame from its own thread; the shared owner makes that safe.
      auto* keep = new std::shared_ptr<const void>(array.owner());
      zmq::message_t frame(const_cast<std::byte*>(array.bytes().data()), array.bytes().size(),
                           [](void*, void* hint) {
                             take_over();
                             delete static_cast<std::shared_ptr<const void>*>(hint);
                           },
                           keep);
      if (!socket.send(frame, more(k + 1 < message.arrays.size()))) return false;
    }
    return true;
  } catch (const zmq::error_t& error) {
    if (error.num() == EHOSTUNREACH || error.num() == EAGAIN) return false;
    throw;
  }
}

std::optional<Parcel> receive_parcel(zmq::socket_t& socket, std::chrono::milliseconds wait, bool has_identity) {
  if (wait.count() > 0) {
    zmq::pollitem_t item{socket.handle(), 0, ZMQ_POLLIN, 0};
    try {
      if (zmq::poll(&item, 1, wait) == 0) return std::nullopt;
    } catch (const zmq::error_t& error) {
      if (error.num() == EINTR) return std::nullopt;  // a signal: the caller looks at its flags and comes back
      throw;
    }
  }
  auto flags = zmq::recv_flags::dontwait;  // the rest of a message is there when its first frame is
  Parcel parcel;
  bool first = has_identity;
  for (bool more = true; more;) {
    auto part = std::make_shared<zmq::message_t>();
    while (true) {
      try {
        if (!socket.recv(*part, flags)) return std::nullopt;
        flags = zmq::recv_flags::none;
        take_over();
        break;
      } catch (const zmq::error_t& error) {
        if (error.num() != EINTR) throw;
      }
    }
    more = part->more();
    if (std::exchange(first, false)) {
      parcel.identity = part->to_string();
      continue;
    }
    const auto* data = static_cast<const std::byte*>(part->data());
    const auto size = part->size();
    parcel.frames.push_back({std::move(part), data, size});
  }
  return parcel;
}

Channel::Channel(zmq::context_t& context, const std::string& endpoint, const Keys* keys) : socket_(context, zmq::socket_type::dealer) {
  check_endpoint(endpoint, keys);
  if (keys) use_as_participant(socket_, endpoint, *keys);
  socket_.set(zmq::sockopt::linger, 2000);  // last words reach the coupler
  socket_.set(zmq::sockopt::sndtimeo, 2000);  // without a peer a send would wait for ever
  socket_.set(zmq::sockopt::reconnect_ivl, 20);  // ms; the coupler may bind after we connect
  socket_.set(zmq::sockopt::sndhwm, 0);
  socket_.set(zmq::sockopt::rcvhwm, 0);
  socket_.connect(endpoint);
}

void Channel::send(const Message& message) {
  if (!protocol::send(socket_, message, {}, memory_.answers.get())) throw ProtocolError("the coupler is gone: nothing can be sent to it");
}

std::optional<Message> Channel::receive(std::chrono::milliseconds wait) {
  const auto parcel = receive_parcel(socket_, wait, false);
  if (!parcel) return std::nullopt;
  return decode(parcel->frames, {}, memory_.requests.get());
}

bool Channel::use(const MemoryOffer& offer) {
  auto memory = MemoryPair::open(offer);
  if (!memory.is_there()) return false;
  memory_ = std::move(memory);
  return true;
}

}  // namespace acopla::protocol
