#include "protocol/serve.h"

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

// The solver's half of the state machine (docs/protocol.md, §3): connected → introduced → started → ready ⇄ advancing →
// finished. `state` is what an error message names.
class Session {
 public:
  Session(Participant& participant, const ServeOptions& options, zmq::context_t& context)
      : participant_(participant), options_(options), context_(context), channel_(context, options.endpoint) {}

  void run() {
    try {
      introduce();
      state_ = "starting";
      const auto surfaces = participant_.start(run_);
      for (const auto& surface : surfaces) points_[surface.name] = surface.mesh.points.size();
      channel_.send(interface_message(surfaces));
      state_ = "ready";
      while (answer(next_request())) {
      }
    } catch (const io::UserError& error) {
      report(error.what(), true);
      throw;
    } catch (const std::exception& error) {
      report(error.what());
      throw;
    } catch (...) {
      report("an exception that is not a std::exception");
      throw;
    }
  }

 private:
  void introduce() {
    channel_.send(hello_message(options_.name, participant_.introduce()));
    const auto message = next_request();
    if (message.kind != Kind::welcome) out_of_turn(message);
    auto welcome = read_welcome(message);
    run_ = std::move(welcome.run);
    pulse_.emplace(context_, welcome.pulse_endpoint, options_.name);
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

  /// @return false when the run is over
  bool answer(const Message& request) {
    Message reply;
    try {
      reply = compute(request);
    } catch (const Unsupported& error) {  // the coupler decides what that means; this solver goes on
      reply = error_message(error.what(), state_, true);
    }
    reply.sequence = request.sequence;
    channel_.send(reply);
    state_ = "ready";
    return request.kind != Kind::finish;
  }

  Message compute(const Message& request) {
    switch (request.kind) {
      case Kind::advance: {
        const auto asked = read_advance(request, run_.uses);
        check_points(asked.fields);
        state_ = fmt::format("advancing from {:.6g} s to {:.6g} s", run_.time(asked.start), run_.time(asked.end));
        const Window window{asked.start, asked.end, run_.time(asked.start), run_.time(asked.end - asked.start), asked.estimate};
        return advanced_message(participant_.advance(window, asked.fields));
      }
      case Kind::save: participant_.save(); return done_message();
      case Kind::restore: participant_.restore(); return done_message();
      case Kind::finish:
        state_ = "finishing";
        return done_message(with_peak(participant_.finish()));
      case Kind::checkpoint:
        state_ = "writing a checkpoint";
        participant_.checkpoint(read_folder(request));
        return done_message();
      case Kind::resume:
        state_ = "resuming from a checkpoint";
        participant_.resume(read_folder(request));
        return done_message();
      default: out_of_turn(request);
    }
  }

  void check_points(const std::vector<Field>& fields) const {
    for (const auto& field : fields) {
      const auto known = points_.find(field.surface);
      if (known != points_.end() && field.values.size() != known->second)
        throw ProtocolError(fmt::format("{} on {} came with {} values for {} points", field.name, field.surface, field.values.size(), known->second));
    }
  }

  [[noreturn]] void out_of_turn(const Message& message) const {
    throw ProtocolError(fmt::format("the coupler sent {} to {} while it was {}", name_of(message.kind), options_.name, state_));
  }

  void report(const std::string& text, bool mistake = false) {
    if (coupler_knows_) return;
    try {
      channel_.send(error_message(text, state_, false, mistake));
    } catch (const std::exception&) {  // nobody listens any more; the exception that is being reported goes on
    }
  }

  Participant& participant_;
  const ServeOptions& options_;
  zmq::context_t& context_;
  Channel channel_;
  std::optional<Pulse> pulse_;
  Run run_;
  std::map<std::string, std::size_t> points_;  // of the surfaces that were offered
  std::string state_ = "connected";
  bool coupler_knows_ = false;
};

}  // namespace

void serve(Participant& participant, const ServeOptions& options) {
  if (options.context) {
    Session(participant, options, *options.context).run();
    return;
  }
  zmq::context_t context;
  Session(participant, options, context).run();
}

}  // namespace acopla::protocol
