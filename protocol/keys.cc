#include "protocol/keys.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <map>
#include <vector>

#include "io/error.h"
#include "protocol/channel.h"

namespace acopla::protocol {
namespace {

constexpr std::size_t text_length = 40;  // of a key in Z85
constexpr const char* domain = "acopla";  // any text: without one ZeroMQ does not ask

struct Pair {
  std::string open, secret;
};

Pair new_pair() {
  std::array<char, text_length + 1> open{}, secret{};
  if (zmq_curve_keypair(open.data(), secret.data()) != 0) throw io::UserError("this libzmq was built without CURVE. Install Debian's libzmq5.");
  return {open.data(), secret.data()};
}

void write_keys(const std::string& path, const char* about, const Keys& keys) {
  const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (file < 0)
    throw io::UserError({path, 0, 0}, errno == EEXIST ? std::string("exists already. Choose another folder, or remove it, which ends all use of its keys.")
                                                      : fmt::format("cannot be written: {}.", std::strerror(errno)));
  const auto text = fmt::format("# {}\npublic {}\nsecret {}\nother {}\n", about, keys.own_public, keys.own_secret, keys.other_public);
  const bool written = ::write(file, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  if (::close(file) != 0 || !written) throw io::UserError({path, 0, 0}, "cannot be written whole. Check the free space.");
}

Keys read_keys(const std::string& path) {
  struct stat about {};
  if (::stat(path.c_str(), &about) != 0) throw io::UserError({path, 0, 0}, "cannot be read. Make keys by `acopla keys DIR`, and copy participant.keys to where participants run.");
  if (about.st_mode & (S_IRWXG | S_IRWXO)) throw io::UserError({path, 0, 0}, fmt::format("may be read by others. Use chmod 600 {}, and make new keys if others did.", path));
  std::ifstream stream(path);
  std::map<std::string, std::string> entries;
  for (std::string word, value; stream >> word;) {
    if (word.starts_with('#')) std::getline(stream, value);
    else if (stream >> value) entries[word] = value;
  }
  for (const char* word : {"public", "secret", "other"}) {
    std::array<std::uint8_t, 32> bytes{};
    if (entries[word].size() != text_length || !zmq_z85_decode(bytes.data(), entries[word].c_str()))
      throw io::UserError({path, 0, 0}, fmt::format("holds no key \"{}\". Make keys by `acopla keys DIR`.", word));
  }
  return {entries["public"], entries["secret"], entries["other"]};
}

bool is_tcp(const std::string& endpoint) { return endpoint.starts_with("tcp://"); }

}  // namespace

void make_keys(const std::string& folder) {
  if (::mkdir(folder.c_str(), 0700) != 0 && errno != EEXIST)
    throw io::UserError({folder, 0, 0}, fmt::format("the folder cannot be made: {}.", std::strerror(errno)));
  const auto coupler = new_pair(), participant = new_pair();
  write_keys(folder + "/coupler.keys", "Acopla: keys of the coupler. Keep it where the coupler runs, and secret.", {coupler.open, coupler.secret, participant.open});
  write_keys(folder + "/participant.keys", "Acopla: keys of all participants. Who has this file may take part in a run.",
             {participant.open, participant.secret, coupler.open});
}

Keys read_coupler_keys(const std::string& folder) { return read_keys(folder + "/coupler.keys"); }
Keys read_participant_keys(const std::string& folder) { return read_keys(folder + "/participant.keys"); }

std::string keys_of_environment() {
  const char* folder = std::getenv("ACOPLA_KEYS");
  return folder ? folder : "";
}

void use_as_coupler(zmq::socket_t& socket, const std::string& endpoint, const Keys& keys) {
  if (!is_tcp(endpoint)) return;
  socket.set(zmq::sockopt::zap_domain, domain);
  socket.set(zmq::sockopt::curve_server, true);
  socket.set(zmq::sockopt::curve_secretkey, keys.own_secret);
}

void use_as_participant(zmq::socket_t& socket, const std::string& endpoint, const Keys& keys) {
  if (!is_tcp(endpoint)) return;
  socket.set(zmq::sockopt::curve_serverkey, keys.other_public);
  socket.set(zmq::sockopt::curve_publickey, keys.own_public);
  socket.set(zmq::sockopt::curve_secretkey, keys.own_secret);
}

Gate::Gate(zmq::context_t& context, const Keys& keys) : socket_(context, zmq::socket_type::rep), allowed_(32, '\0') {
  zmq_z85_decode(reinterpret_cast<std::uint8_t*>(allowed_.data()), keys.other_public.c_str());
  socket_.set(zmq::sockopt::linger, 0);
  socket_.bind("inproc://zeromq.zap.01");
  thread_ = std::thread([this] { run(); });
}

Gate::~Gate() {
  stop_ = true;
  thread_.join();
}

// Request: version, request id, domain, address, identity, mechanism, key. Answer: version, id, status, text, user, metadata.
void Gate::run() {
  while (!stop_) {
    const auto parcel = receive_parcel(socket_, std::chrono::milliseconds(50), false);
    if (!parcel) continue;
    std::vector<std::string> asked;
    for (const auto& frame : parcel->frames) asked.emplace_back(reinterpret_cast<const char*>(frame.data), frame.size);
    const bool known = asked.size() == 7 && asked[0] == "1.0" && asked[5] == "CURVE" && asked[6] == allowed_;
    const std::array<std::string, 6> answer{"1.0", asked.size() > 1 ? asked[1] : "", known ? "200" : "400", known ? "OK" : "unknown key", "", ""};
    for (std::size_t k = 0; k < answer.size(); ++k)
      socket_.send(zmq::buffer(answer[k]), k + 1 < answer.size() ? zmq::send_flags::sndmore : zmq::send_flags::none);
  }
}

}  // namespace acopla::protocol
