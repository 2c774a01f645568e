#include "conformance/rehearsal.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace acopla::conformance {
namespace {

using protocol::Kind;
using protocol::Message;
using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

// An exit is often seen before the last message of the process has been read.
constexpr auto last_words_wait = 300ms;

double seconds(std::chrono::milliseconds time) { return static_cast<double>(time.count()) / 1000; }

std::string after(const std::string& words) { return words.empty() ? "" : fmt::format("; its last words: {}", words); }

}  // namespace

Rehearsal::Rehearsal(Subject& subject, const Plan& plan, bool pings)
    : subject_(subject), plan_(plan), hub_(context_, plan.endpoint), pulse_(std::make_unique<PulseLog>(context_, plan.endpoint + ".pulse", pings)) {
  subject_.start(hub_.endpoint());
}

Rehearsal::~Rehearsal() { subject_.end(); }

Message Rehearsal::hear(std::chrono::milliseconds limit, const std::string& what) {
  const auto begin = Clock::now();
  std::optional<Clock::time_point> gone;
  while (true) {
    if (auto arrival = hub_.receive(20ms)) {
      if (!peer_.empty() && arrival->peer != peer_) throw Broken(fmt::format("sent something from a second socket while {} was expected", what));
      peer_ = arrival->peer;
      if (!arrival->message) throw Broken(fmt::format("sent something that is not the protocol where {} was expected: {}", what, arrival->fault));
      return std::move(*arrival->message);
    }
    if (!gone && subject_.ended()) gone = Clock::now();
    if (gone && Clock::now() - *gone > last_words_wait)
      throw Broken(fmt::format("{} where {} was expected{}", subject_.ended()->how, what, after(subject_.last_words())));
    if (Clock::now() - begin > limit) throw Broken(fmt::format("did not send {} within {:.3g} s", what, seconds(limit)));
  }
}

protocol::Hello Rehearsal::hear_hello() {
  const auto message = hear(plan_.start_limit, "hello");
  if (message.kind != Kind::hello) throw Broken(fmt::format("sent {} where hello was expected", protocol::name_of(message.kind)));
  auto hello = protocol::read_hello(message);
  if (hello.participant != plan_.participant)
    throw Broken(fmt::format("says hello as \"{}\", and its name is \"{}\" (ACOPLA_PARTICIPANT)", hello.participant, plan_.participant));
  return hello;
}

void Rehearsal::say_welcome(bool strange, bool resumes) {
  auto run = plan_.run;
  run.resumes = resumes;
  auto message = protocol::welcome_message(run, pulse_->endpoint());
  if (strange) message.body["of_a_later_release"] = {{"nobody", "knows"}};
  hub_.send(peer_, message);
  pulse_->mark();
}

void Rehearsal::say_welcome_with_memory() {
  hub_.send(peer_, protocol::welcome_message(plan_.run, pulse_->endpoint(), hub_.offer_memory(peer_)));
  pulse_->mark();
}

std::vector<protocol::Surface> Rehearsal::hear_interface() {
  const auto message = hear(plan_.start_limit, "interface");
  if (message.kind == Kind::error)
    throw Broken(fmt::format("answered welcome by an error: {}", protocol::read_error(message).text));
  if (message.kind != Kind::interface) throw Broken(fmt::format("sent {} where interface was expected", protocol::name_of(message.kind)));
  surfaces_ = protocol::read_interface(message);
  shares_memory_ = protocol::found_memory(message);
  if (shares_memory_) hub_.use_memory(peer_);
  return surfaces_;
}

void Rehearsal::open(bool strange, bool resumes) {
  hear_hello();
  say_welcome(strange, resumes);
  hear_interface();
}

void Rehearsal::say(Message message) { hub_.send(peer_, message); }

void Rehearsal::say_bytes(const std::vector<std::string>& frames) {
  hub_.socket().send(zmq::buffer(peer_), zmq::send_flags::sndmore);
  for (std::size_t k = 0; k < frames.size(); ++k)
    hub_.socket().send(zmq::buffer(frames[k]), k + 1 < frames.size() ? zmq::send_flags::sndmore : zmq::send_flags::none);
}

Message Rehearsal::ask(Message request) {
  request.sequence = ++sequence_;
  hub_.send(peer_, request);
  const auto begin = Clock::now();
  auto answer = hear(plan_.answer_limit, fmt::format("an answer to {}", protocol::name_of(request.kind)));
  if (request.kind == Kind::advance)
    longest_window_ = std::max(longest_window_, std::chrono::duration_cast<std::chrono::milliseconds>(Clock::now() - begin));
  return answer;
}

Message Rehearsal::ask(Message request, Kind wanted) {
  const auto kind = request.kind;
  auto answer = ask(std::move(request));
  if (answer.kind == Kind::error && wanted != Kind::error)
    throw Broken(fmt::format("answered {} by an error: {}", protocol::name_of(kind), protocol::read_error(answer).text));
  if (answer.kind != wanted)
    throw Broken(fmt::format("answered {} by {}, not {}", protocol::name_of(kind), protocol::name_of(answer.kind), protocol::name_of(wanted)));
  if (answer.sequence != sequence_)
    throw Broken(fmt::format("gave its answer to {} the number {}, the request's is {}", protocol::name_of(kind), answer.sequence, sequence_),
                 "sequence");
  return answer;
}

Message Rehearsal::ask(Kind kind, Kind wanted) {
  Message request;
  request.kind = kind;
  return ask(std::move(request), wanted);
}

Message Rehearsal::advance_request(std::int64_t window, const Fields& given) const {
  return protocol::advance_message({window, window + 1, 0, 0}, given);
}

Message Rehearsal::advance(std::int64_t window, const Fields& given) { return ask(advance_request(window, given), Kind::advanced); }

void Rehearsal::hear_its_error(const std::string& cause) {
  const auto message = hear(plan_.answer_limit, fmt::format("an error after {}", cause));
  if (message.kind != Kind::error) throw Broken(fmt::format("sent {} after {}, not error", protocol::name_of(message.kind), cause));
  const auto error = protocol::read_error(message);
  if (error.unsupported) throw Broken(fmt::format("called {} unsupported, as if it were a request; it is a fault", cause));
  if (error.text.empty()) throw Broken(fmt::format("sent an error without a text after {}", cause));
  const auto ending = hear_its_end(cause);
  if (ending.killed || ending.code == 0) throw Broken(fmt::format("{} after {} and its error; the exit code should tell that it failed", ending.how, cause));
}

Ending Rehearsal::hear_its_end(const std::string& cause) {
  const auto begin = Clock::now();
  while (Clock::now() - begin < plan_.exit_limit) {
    if (const auto ending = subject_.ended()) return *ending;
    hub_.receive(20ms);  // what it still says is heard, and changes nothing
  }
  throw Broken(fmt::format("did not end within {:.3g} s after {}", seconds(plan_.exit_limit), cause));
}

std::optional<std::string> Rehearsal::hear_anything(std::chrono::milliseconds time) {
  const auto until = Clock::now() + time;
  while (Clock::now() < until)
    if (const auto arrival = hub_.receive(20ms))
      return arrival->message ? std::string(protocol::name_of(arrival->message->kind)) : "something that is not the protocol";
  return std::nullopt;
}

bool Rehearsal::receives() const { return !fields(0, 0).empty(); }
Rehearsal::Fields Rehearsal::zero_fields() const { return fields(0, 0); }
Rehearsal::Fields Rehearsal::small_fields(int seed) const { return fields(1, seed); }

// A millinewton a point, and motion of a millionth of the surface's size a window: noticed by every solver, dangerous to none.
Rehearsal::Fields Rehearsal::fields(double amplitude, int seed) const {
  Fields fields;
  for (const auto& use : plan_.run.uses)
    for (const auto& name : use.receives)
      for (const auto& surface : surfaces_) {
        if (surface.name != use.surface) continue;
        const double move = 1e-6 * std::max(surface.mesh.extent(), 1e-3);
        const double size = amplitude * (name == "force" ? 1e-3 : name.ends_with("velocity") ? move / plan_.run.tick : move);
        protocol::Field field{surface.name, name, {}};
        for (std::size_t p = 0; p < surface.mesh.points.size(); ++p) {
          const double phase = 0.7 * static_cast<double>(p) + 1.3 * seed;
          field.values.emplace_back(size * std::sin(1 + phase), size * std::cos(phase), plan_.dimension == 3 ? -size * std::sin(2 + phase) : 0);
        }
        fields.push_back(std::move(field));
      }
  return fields;
}

}  // namespace acopla::conformance
