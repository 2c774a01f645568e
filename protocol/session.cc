#include "protocol/session.h"

#include <fmt/format.h>
#include <sys/resource.h>

#include <map>
#include <optional>

#include "io/error.h"
#include "protocol/channel.h"
#include "protocol/exchange.h"
#include "protocol/pulse.h"

namespace acopla::protocol {
namespace {

// Adds the most memory this process ever held, unless the solver knows better.
std::vector<std::pair<std::string, double>> with_peak(std::vector<std::pair<std::string, double>> values) {
  for (const auto& [name, value] : values)
    if (name == "peak_bytes") return values;
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  values.emplace_back("peak_bytes", static_cast<double>(usage.ru_maxrss) * 1024);
  return values;
}

// A coupler that listens on every address of its machine does not know by which of them it is seen: the one that reached it will do.
std::string reachable(const std::string& pulse, const std::string& hub) {
  for (const std::string any : {"tcp://0.0.0.0:", "tcp://[::]:"})
    if (pulse.starts_with(any)) return hub.substr(0, hub.rfind(':') + 1) + pulse.substr(any.size());
  return pulse;
}

}  // namespace

// The solver's half of the state machine (docs/protocol.md, §3): connected → introduced → started → ready ⇄ advancing →
// finished. `state_` is what an error message names.
class Session::Line {
 public:
  Line(const Introduction& introduction, const ServeOptions& options, Handlers handlers)
      : options_(options),
        handlers_(std::move(handlers)),
        own_context_(options.context ? nullptr : new zmq::context_t),
        context_(options.context ? *options.context : *own_context_),
        keys_(options.keys.empty() || !options.endpoint.starts_with("tcp://") ? std::nullopt : std::optional(read_participant_keys(options.keys))),
        channel_(context_, options.endpoint, keys_ ? &*keys_ : nullptr) {
    reporting([&] {
      channel_.send(hello_message(options_.name, introduction));
      const auto message = next_request();
      if (message.kind != Kind::welcome) out_of_turn(message);
      auto welcome = read_welcome(message);
      run_ = std::move(welcome.run);
      shares_memory_ = welcome.memory && channel_.use(*welcome.memory);
      pulse_.emplace(context_, reachable(welcome.pulse_endpoint, options_.endpoint), options_.name, keys_ ? &*keys_ : nullptr);
      state_ = "starting";
    });
  }

  const Run& run() const { return run_; }
  const std::vector<Field>& received() const { return received_; }

  void offer(const std::vector<Surface>& surfaces) {
    for (const auto& surface : surfaces) points_[surface.name] = surface.mesh.points.size();
    channel_.send(interface_message(surfaces, shares_memory_));
    state_ = "ready";
  }

  bool next(Window& window) {
    bool goes_on = false;
    reporting([&] {
      auto request = next_request();
      while (request.kind != Kind::advance && request.kind != Kind::finish) {
        attend(request);
        request = next_request();
      }
      sequence_ = request.sequence;
      goes_on = request.kind == Kind::advance;
      if (goes_on) begin(request, window);
      else state_ = "finishing";
    });
    return goes_on;
  }

  void answer(Message reply) {
    reply.sequence = sequence_;
    channel_.send(reply);
    state_ = "ready";
  }

  void finish(std::vector<std::pair<std::string, double>> values) {
    answer(done_message(with_peak(std::move(values))));
    coupler_knows_ = true;
  }

  void fail(const std::string& text, bool mistake) noexcept {
    if (std::exchange(coupler_knows_, true)) return;
    try {
      channel_.send(error_message(text, state(), false, mistake));
    } catch (const std::exception&) {  // nobody listens any more
    }
  }

 private:
  // Whatever goes wrong reaches the coupler before it leaves.
  template <class Act>
  void reporting(const Act& act) {
    try {
      act();
    } catch (const io::UserError& error) {
      fail(error.what(), true);
      throw;
    } catch (const std::exception& error) {
      fail(error.what(), false);
      throw;
    } catch (...) {
      fail("an exception that is not a std::exception", false);
      throw;
    }
  }

  Message next_request() {
    const auto begin = std::chrono::steady_clock::now();
    while (true) {
      if (auto message = channel_.receive(std::chrono::milliseconds(100))) {
        if (message->kind == Kind::error) {
          coupler_knows_ = true;
          throw ProtocolError(fmt::format("the coupler ended the run: {}", read_error(*message).text));
        }
        return std::move(*message);
      }
      const auto silence = pulse_ ? pulse_->silence()
                                  : std::chrono::duration_cast<std::chrono::milliseconds>(std::chrono::steady_clock::now() - begin);
      if (silence > options_.patience)
        throw ProtocolError(fmt::format("no sign of a coupler at {} for {:.1f} s. Start it first, and check the address.",
                                        options_.endpoint, static_cast<double>(silence.count()) / 1000));
    }
  }

  void begin(const Message& request, Window& window) {
    auto asked = read_advance(request, run_.uses);
    for (const auto& field : asked.fields) {
      const auto known = points_.find(field.surface);
      if (known != points_.end() && field.values.size() != known->second)
        throw ProtocolError(fmt::format("{} on {} came with {} values for {} points", field.name, field.surface, field.values.size(), known->second));
    }
    window = window_ = {asked.start, asked.end, run_.time(asked.start), run_.time(asked.end - asked.start), asked.estimate};
    state_ = "advancing";
    received_ = std::move(asked.fields);
  }

  // Put into words when somebody asks: windows are many.
  std::string state() const {
    return state_ == "advancing" ? fmt::format("advancing from {:.6g} s to {:.6g} s", window_.start_time, window_.end_time()) : std::string(state_);
  }

  // What comes between windows.
  void attend(const Message& request) {
    sequence_ = request.sequence;
    try {
      switch (request.kind) {
        case Kind::save: call(handlers_.save, "save its state"); break;
        case Kind::restore: call(handlers_.restore, "restore its state"); break;
        case Kind::checkpoint:
          state_ = "writing a checkpoint";
          call(handlers_.checkpoint, "write a checkpoint", read_folder(request));
          break;
        case Kind::resume:
          state_ = "resuming from a checkpoint";
          call(handlers_.resume, "resume from a checkpoint", read_folder(request));
          break;
        default: out_of_turn(request);
      }
    } catch (const Unsupported& error) {  // the coupler decides what that means; this solver goes on
      return answer(error_message(error.what(), state(), true));
    }
    answer(done_message());
  }

  template <class Handler, class... Arguments>
  void call(const Handler& handler, const char* what, const Arguments&... arguments) const {
    if (!handler) throw Unsupported(fmt::format("this solver cannot {}", what));
    handler(arguments...);
  }

  [[noreturn]] void out_of_turn(const Message& message) const {
    throw ProtocolError(fmt::format("the coupler sent {} to {} while it was {}", name_of(message.kind), options_.name, state()));
  }

  const ServeOptions options_;
  const Handlers handlers_;
  std::unique_ptr<zmq::context_t> own_context_;
  zmq::context_t& context_;
  std::optional<Keys> keys_;
  Channel channel_;
  std::optional<Pulse> pulse_;
  Run run_;
  std::map<std::string, std::size_t> points_;  // of the surfaces that were offered
  std::vector<Field> received_;
  std::uint64_t sequence_ = 0;  // of the request that is under way
  std::string_view state_ = "connected";
  Window window_{};  // the last that was asked for
  bool shares_memory_ = false;  // with the coupler
  bool coupler_knows_ = false;  // that it is over
};

Session::Session(const Introduction& introduction, const ServeOptions& options, Handlers handlers)
    : line_(std::make_unique<Line>(introduction, options, std::move(handlers))) {}
Session::~Session() { line_->fail("this solver left before the run's end", false); }

const Run& Session::run() const { return line_->run(); }
void Session::offer(const std::vector<Surface>& surfaces) { line_->offer(surfaces); }
bool Session::next(Window& window) { return line_->next(window); }
const std::vector<Field>& Session::received() const { return line_->received(); }
void Session::answer(Advance advance) { line_->answer(advanced_message(std::move(advance))); }
void Session::finish(std::vector<std::pair<std::string, double>> values) { line_->finish(std::move(values)); }
void Session::fail(const std::string& text, bool mistake) noexcept { line_->fail(text, mistake); }

}  // namespace acopla::protocol
