#include "coupler/crew.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "coupler/failure.h"
#include "protocol/exchange.h"

namespace acopla::coupler {
namespace {

using protocol::Kind;
using protocol::Message;

constexpr std::chrono::milliseconds tick{100};
constexpr auto advancing = "advancing";
constexpr double soon = 3e-3;  // an answer in less [s]
constexpr std::chrono::milliseconds look_interval{100};  // between looks after everybody, while answers come
// An exit is often seen before the last message of the process has been read.
constexpr std::chrono::milliseconds last_words_wait{300};

std::string pulse_endpoint(const std::string& hub) {
  return hub.starts_with("tcp://") ? hub.substr(0, hub.rfind(':')) + ":*" : hub + ".pulse";
}

double seconds_between(std::chrono::steady_clock::time_point from,
                       std::chrono::steady_clock::time_point to) {
  return std::chrono::duration<double>(to - from).count();
}

// What a stranger sent goes to a terminal and a log: nothing but printable characters, and not too
// many.
std::string printable(std::string text) {
  for (auto& c : text)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
  return text.substr(0, 200);
}

}  // namespace

Crew::Crew(zmq::context_t& context, const std::string& endpoint, Case& read,
           const std::string& results, Reporter& reporter, Outside* outside, bool resumes,
           const protocol::Keys* keys)
    : case_(read),
      results_(results),
      resumes_(resumes),
      reporter_(reporter),
      outside_(outside),
      hub_(context, endpoint, keys),
      pulse_(context, pulse_endpoint(hub_.endpoint()), keys),
      begin_(Clock::now()) {
  for (const auto& participant : case_.participants) {
    auto& member = members_[participant.name];
    member.about = &participant;
    member.since = begin_;
    member.outcome.name = participant.name;
    member.outcome.solver = participant.replay ? "replay" : participant.solver;
    if (participant.replay)
      member.replay = std::make_unique<Replay>(*participant.replay, participant.name);
  }
  reporter_.ready(hub_.endpoint());
}

void Crew::assemble() {
  while (case_.window == 0) {
    const auto here = [](const auto& entry) { return entry.second.replay || entry.second.phase == Member::Phase::introduced; };
    if (std::all_of(members_.begin(), members_.end(), here)) divide();
    else turn(tick);
  }
  for (auto& [name, member] : members_)
    if (member.replay) start_replay(member);
  while (!all_are(Member::Phase::idle)) turn(tick);
}

const geometry::SurfaceMesh& Crew::surface(const SurfaceName& name,
                                           const io::Location& asked_at) const {
  const auto& surfaces = members_.at(name.participant).surfaces;
  const auto found = surfaces.find(name.surface);
  if (found != surfaces.end()) return found->second;
  std::vector<std::string> known;
  for (const auto& [surface, mesh] : surfaces) known.push_back(surface);
  const auto near = io::nearest_word(name.surface, known);
  throw io::UserError(
      asked_at,
      fmt::format("{} has no surface \"{}\". {}", name.participant, name.surface,
                  near            ? fmt::format("Did you mean \"{}.{}\"?", name.participant, *near)
                  : known.empty() ? std::string("It offers none.")
                                  : fmt::format("It offers: {}.", fmt::join(known, ", "))));
}

void Crew::begin_advance(const std::string& participant, std::int64_t start, std::int64_t end,
                         std::vector<protocol::Field> fields, bool estimate) {
  auto& member = members_.at(participant);
  const protocol::Window window{start, end, case_.time(start), case_.time(end) - case_.time(start), estimate};
  enter(member, Member::Phase::advancing, advancing);
  member.window = window;
  if (member.replay) {
    take_advance(member, member.replay->advance(window, fields));
    return;
  }
  request(member, protocol::advance_message(window, std::move(fields)));
}

std::vector<std::string> Crew::everybody() const {
  std::vector<std::string> names;
  for (const auto& [name, member] : members_) names.push_back(name);
  return names;
}

void Crew::ask(const std::vector<std::string>& participants, Kind kind, const std::string& folder) {
  const auto what = kind == Kind::save         ? "saving its state"
                    : kind == Kind::checkpoint ? "writing a checkpoint"
                    : kind == Kind::resume     ? "resuming from a checkpoint"
                                               : "returning to the window's start";
  for (const auto& name : participants) {
    auto& member = members_.at(name);
    if (member.replay) continue;  // what it plays follows from the window alone
    enter(member, Member::Phase::returning, what);
    Message message;
    message.kind = kind;
    if (!folder.empty()) message = protocol::folder_message(kind, folder);
    request(member, std::move(message));
  }
  const auto busy = [&](const std::string& name) { return members_.at(name).phase == Member::Phase::returning; };
  while (std::any_of(participants.begin(), participants.end(), busy)) turn(tick);
}

Crew::Answer Crew::next_answer() {
  while (answers_.empty()) turn(tick);
  auto answer = std::move(answers_.front());
  answers_.pop_front();
  return answer;
}

// A thread that carries a request, ZeroMQ's here or the participant's, is often woken on the core of whoever computes, and waits there until
// that one has used up its slice, which may be three milliseconds. So we sleep for one, unless the answer may be here by then.
void Crew::give_way() {
  constexpr std::chrono::milliseconds pause{1};
  if (answers_.empty() && !answers_soon()) turn(pause);
}

bool Crew::answers_soon() const {
  return std::any_of(members_.begin(), members_.end(),
                     [](const auto& entry) { return entry.second.phase == Member::Phase::advancing && entry.second.last_advance < soon; });
}

std::vector<std::pair<std::string, double>> Crew::finish() {
  for (auto& [name, member] : members_) {
    enter(member, member.replay ? Member::Phase::finished : Member::Phase::finishing, "finishing");
    if (member.replay) continue;
    Message message;
    message.kind = Kind::finish;
    request(member, std::move(message));
  }
  while (!all_are(Member::Phase::finished)) turn(tick);
  return last_values_;
}

void Crew::dismiss(const std::string& why) noexcept {
  for (auto& [name, member] : members_) {
    if (member.peer.empty() || member.phase == Member::Phase::finished) continue;
    try {
      hub_.send(member.peer, protocol::error_message(why, "ending"));
    } catch (const std::exception&) {  // gone already
    }
  }
}

std::vector<ParticipantOutcome> Crew::outcomes() const {
  std::vector<ParticipantOutcome> all;
  for (const auto& participant : case_.participants)
    all.push_back(members_.at(participant.name).outcome);
  return all;
}

// One turn of the loop: waits for whatever comes first, hears all that is there, and looks after
// everybody.
void Crew::turn(std::chrono::milliseconds wait) {
  std::vector<zmq::pollitem_t> items{{hub_.socket().handle(), 0, ZMQ_POLLIN, 0}};
  if (outside_)
    for (const int descriptor : outside_->descriptors())
      items.push_back({nullptr, descriptor, ZMQ_POLLIN, 0});
  try {
    zmq::poll(items.data(), items.size(), wait);
  } catch (const zmq::error_t& error) {
    if (error.num() != EINTR) throw;
  }
  // An answer goes first: what else has come is there at the next turn. A flood must not keep us from looking after the others.
  for (int k = 0; k < 64 && answers_.empty(); ++k) {
    auto arrival = hub_.receive(std::chrono::milliseconds(0));
    if (!arrival) break;
    hear(std::move(*arrival));
  }
  const auto now = Clock::now();
  if (!answers_.empty() && now - looked_ < look_interval) return;
  looked_ = now;
  if (outside_)
    for (const auto& notice : outside_->read()) heed(notice);
  check_health();
}

void Crew::hear(protocol::Arrival arrival) {
  auto* member = with_peer(arrival.peer);
  if (!member) {
    hear_stranger(arrival);
  } else if (!arrival.message) {
    fail(*member, fmt::format("sent something that is not the protocol: {}", arrival.fault));
  } else {
    try {
      hear_member(*member, std::move(*arrival.message));
    } catch (const protocol::ProtocolError& error) {
      fail(*member, fmt::format("sent a message that cannot be used: {}", error.what()));
    }
  }
}

void Crew::hear_member(Member& member, Message message) {
  using Phase = Member::Phase;
  if (message.kind == Kind::error) {
    const auto error = protocol::read_error(message);
    if (!error.state.empty()) member.state = error.state;
    if (error.mistake)
      throw Failure(member.about->name, state_of(member), error.text, Failure::Cause::mistake);
    throw Failure(member.about->name, state_of(member),
                  fmt::format("{} ({}) failed while {}: {}", member.about->name,
                              member.about->program(), state_of(member), error.text));
  }
  const bool in_turn = (member.phase == Phase::starting && message.kind == Kind::interface) ||
                       (member.phase == Phase::advancing && message.kind == Kind::advanced) ||
                       (member.phase == Phase::returning && message.kind == Kind::done) ||
                       (member.phase == Phase::finishing && message.kind == Kind::done);
  if (!in_turn) fail(member, fmt::format("sent {} out of turn", protocol::name_of(message.kind)));
  if (member.phase != Phase::starting && message.sequence != member.sequence)
    fail(member,
         fmt::format("answered request {} while {} was asked", message.sequence, member.sequence));
  if (message.kind == Kind::interface) {
    if (protocol::found_memory(message)) hub_.use_memory(member.peer);
    take_surfaces(member, protocol::read_interface(message));
  }
  if (message.kind == Kind::advanced) return take_advance(member, protocol::read_advanced(std::move(message)));
  if (message.kind != Kind::done) return;
  if (member.phase == Phase::returning) enter(member, Phase::idle, "waiting for the others");
  else take_end(member, message);
}

void Crew::hear_stranger(const protocol::Arrival& arrival) {
  if (!arrival.message) {
    refuse(arrival.peer, fmt::format("this is not the protocol: {}", arrival.fault));
  } else if (arrival.message->kind == Kind::hello) {
    try {
      admit(arrival.peer, *arrival.message);
    } catch (const protocol::ProtocolError& error) {
      refuse(arrival.peer, error.what());
    }
  } else if (arrival.message->kind != Kind::error) {  // an error is never answered by an error
    refuse(arrival.peer,
           fmt::format("{} came before hello", protocol::name_of(arrival.message->kind)));
  }
}

void Crew::admit(const std::string& peer, const Message& message) {
  const auto hello = protocol::read_hello(message);
  const auto found = members_.find(hello.participant);
  if (found == members_.end() || found->second.replay) {
    std::vector<std::string> names;
    for (const auto& [name, member] : members_)
      if (!member.replay) names.push_back(name);
    return refuse(peer, fmt::format("there is no participant \"{}\" here; there are: {}",
                                    printable(hello.participant), fmt::join(names, ", ")));
  }
  auto& member = found->second;
  if (member.phase != Member::Phase::absent)
    return refuse(peer, fmt::format("{} is connected already; end this process or the other",
                                    hello.participant));
  if (hello.version_low > protocol::version || hello.version_high < protocol::version) {
    const auto why = fmt::format(
        "speaks protocol versions {} to {}, this coupler speaks {}. Use programs of one release",
        hello.version_low, hello.version_high, protocol::version);
    refuse(peer, why);
    fail(member, why);
  }
  if (hello.introduction.dimension != case_.dimension) {
    const auto why = fmt::format("works in {} dimensions, the case has {}",
                                 hello.introduction.dimension, case_.dimension);
    refuse(peer, why);
    fail(member, why);
  }
  const auto& can = hello.introduction.capabilities;
  if (case_.scheme == SchemeKind::serial_implicit && std::find(can.begin(), can.end(), "save") == can.end()) {
    const auto why = "cannot return to the start of a window (it does not offer \"save\"), which scheme = \"implicit\" asks of everybody. "
                     "Use \"explicit\"";
    refuse(peer, why);
    fail(member, why);
  }
  if ((case_.checkpoint_every > 0 || resumes_) && std::find(can.begin(), can.end(), "checkpoint") == can.end()) {
    const auto why = "cannot write or resume from checkpoints (it does not offer \"checkpoint\"), which coupling.checkpoint_every asks of everybody. Leave that out";
    refuse(peer, why);
    fail(member, why);
  }
  member.peer = peer;
  member.step = hello.introduction.step;
  member.saves = std::find(can.begin(), can.end(), "save") != can.end();
  if (member.outcome.solver.empty()) member.outcome.solver = hello.introduction.solver;
  if (case_.window > 0) welcome(member);
  else enter(member, Member::Phase::introduced, "waiting for the others' hellos");
}

void Crew::welcome(Member& member) {
  enter(member, Member::Phase::starting, "starting");
  pulse_.expect(member.about->name);
  if (!hub_.send(member.peer, protocol::welcome_message(run_for(*member.about), pulse_.endpoint(), hub_.offer_memory(member.peer))))
    fail(member, "is gone right after its hello");
}

// Everybody has said hello: the shortest step that somebody named divides the run.
void Crew::divide() {
  double step = 0;
  for (const auto& [name, member] : members_)
    if (member.step > 0 && (step == 0 || member.step < step)) step = member.step;
  if (step == 0)
    throw io::UserError(case_.in_steps.at, "coupling.window is in steps, and no participant here says how long its steps are (dem does). Give seconds.");
  case_.divide(step);
  reporter_.note(case_.in_steps.automatic ? fmt::format("a step is {:.6g} s; windows are of 1 to {} of them.", case_.window, WindowInSteps::longest)
                                          : fmt::format("windows of {:.6g} s, {} steps each.", case_.window, case_.in_steps.count));
  for (auto& [name, member] : members_)
    if (!member.replay) welcome(member);
}

void Crew::refuse(const std::string& peer, const std::string& why) {
  if (notes_left_-- > 0) reporter_.note(fmt::format("a stranger was refused: {}.", printable(why)));
  try {
    hub_.send(peer, protocol::error_message(why, "refused"));
  } catch (const zmq::error_t&) {  // strangers come and go
  }
}

void Crew::take_surfaces(Member& member, std::vector<protocol::Surface> surfaces) {
  for (auto& surface : surfaces) {
    if (surface.name.find('/') != std::string::npos)
      fail(member, fmt::format("offers a surface with a slash in its name, \"{}\"", surface.name));
    member.initial[surface.name] = {std::move(surface.displacement), std::move(surface.velocity), std::move(surface.mass)};
    if (!member.surfaces.emplace(surface.name, std::move(surface.mesh)).second)
      fail(member, fmt::format("offers the surface {} twice", surface.name));
  }
  member.outcome.seconds_starting = seconds_between(member.since, Clock::now());
  enter(member, Member::Phase::idle, "waiting for the others");
}

void Crew::take_advance(Member& member, protocol::Advance advance) {
  for (const auto& field : advance.fields) {
    const auto surface = member.surfaces.find(field.surface);
    if (surface == member.surfaces.end())
      fail(member,
           fmt::format("sent {} on {}, a surface it never offered", field.name, field.surface));
    if (field.values.size() != surface->second.points.size())
      fail(member, fmt::format("sent {} on {} with {} values for {} points", field.name,
                               field.surface, field.values.size(), surface->second.points.size()));
  }
  for (const auto& use : run_for(*member.about).uses)
    for (const auto& wanted : use.sends)
      if (std::none_of(advance.fields.begin(), advance.fields.end(), [&](const auto& field) {
            return field.surface == use.surface && field.name == wanted;
          }))
        fail(member, fmt::format("did not send {} on {}", wanted, use.surface));
  member.outcome.steps += advance.steps;
  enter(member, Member::Phase::idle, "waiting for the others");
  answers_.push_back({member.about->name, std::move(advance)});
}

void Crew::take_end(Member& member, const Message& message) {
  pulse_.forget(member.about->name);
  for (const auto& [name, value] : message.values) {
    if (name == "processes" && value >= 1 && value < 1e6) member.outcome.processes = static_cast<int>(value);
    if (name == "peak_bytes" && value >= 0 && value < 1e18)
      member.outcome.peak_bytes = static_cast<std::uint64_t>(value);
    else
      last_values_.emplace_back(member.about->name + "." + name, value);
  }
  enter(member, Member::Phase::finished, "finished");
}

void Crew::heed(const Notice& notice) {
  if (notice.kind == Notice::Kind::interrupt) throw Interrupted();
  const auto found = members_.find(notice.participant);
  if (found == members_.end() || found->second.phase == Member::Phase::finished) return;
  auto& member = found->second;
  if (notice.kind == Notice::Kind::exited) hear_last_words(member.peer);
  if (member.phase == Member::Phase::finished) return;
  if (notice.mistake && !notice.last_words.empty())
    throw Failure(notice.participant, state_of(member), notice.last_words, Failure::Cause::mistake);
  fail(member, notice.how);
}

// A participant that ended may have said why; what it said is better than what became of its
// process.
void Crew::hear_last_words(const std::string& peer) {
  if (peer.empty()) return;
  const auto until = Clock::now() + last_words_wait;
  while (Clock::now() < until) {
    auto arrival = hub_.receive(std::chrono::milliseconds(20));
    if (arrival && arrival->peer == peer) hear(std::move(*arrival));
  }
}

void Crew::check_health() {
  if (const auto name = pulse_.frozen()) {
    if (auto& member = members_.at(*name); member.phase != Member::Phase::finished)
      fail(member, fmt::format("has not answered for {:.1f} s: its process is frozen or gone",
                               std::chrono::duration<double>(protocol::ping_limit).count()));
  }
  const auto now = Clock::now();
  for (const auto& [name, member] : members_) {
    using Phase = Member::Phase;
    if (member.phase == Phase::absent && seconds_between(begin_, now) > case_.start_limit)
      fail(member, fmt::format("did not say hello within {:.6g} s (coupling.start_limit). Start "
                               "it, or look at its log",
                               case_.start_limit));
    const bool busy = member.phase == Phase::starting || member.phase == Phase::advancing ||
                      member.phase == Phase::returning || member.phase == Phase::finishing;
    if (busy && member.about->advance_limit &&
        seconds_between(member.since, now) > *member.about->advance_limit)
      fail(member, fmt::format("lives but made no progress for {:.6g} s (its advance_limit)",
                               *member.about->advance_limit));
  }
}

// Put into words when somebody asks: windows are many.
std::string Crew::state_of(const Member& member) {
  if (member.state != advancing) return member.state;
  return fmt::format("advancing from {:.6g} s to {:.6g} s", member.window.start_time, member.window.end_time());
}

// Books the time of the phase that ends.
void Crew::enter(Member& member, Member::Phase phase, const std::string& state) {
  using Phase = Member::Phase;
  const auto now = Clock::now();
  const double spent = seconds_between(member.since, now);
  if (member.phase == Phase::idle) member.outcome.seconds_waiting += spent;
  if (member.phase == Phase::advancing) member.last_advance = spent;
  if (member.phase == Phase::starting || member.phase == Phase::advancing ||
      member.phase == Phase::returning || member.phase == Phase::finishing)
    member.outcome.seconds += spent;
  member.phase = phase;
  member.state = state;
  member.since = now;
}

void Crew::request(Member& member, Message message) {
  message.sequence = ++member.sequence;
  if (hub_.send(member.peer, message)) return;
  // Its connection is gone. The launcher's notice, a moment later, says more.
  for (int k = 0; k < 5; ++k) turn(tick);
  fail(member, "has closed its connection");
}

void Crew::start_replay(Member& member) {
  enter(member, Member::Phase::starting, "starting");
  take_surfaces(member, member.replay->start(run_for(*member.about)));
}

std::vector<protocol::Run::Use> uses_of(const Case& read, const std::string& participant) {
  std::vector<protocol::Run::Use> uses;
  const auto use = [&](const std::string& surface) -> protocol::Run::Use& {
    for (auto& known : uses)
      if (known.surface == surface) return known;
    uses.push_back({surface, {}, {}});
    return uses.back();
  };
  for (const auto& interface : read.interfaces) {
    const bool moves = read.scheme != SchemeKind::one_way && !interface.recorded_only();
    if (interface.from.participant == participant) {
      auto& from = use(interface.from.surface);
      const bool is_followed = interface.slides ||
                               std::find(from.sends.begin(), from.sends.end(), "displacement") != from.sends.end();
      from.sends = {"force"};
      if (is_followed) from.sends.push_back("displacement");
      if (moves) from.receives = {"displacement", "velocity"};
      if (moves && read.scheme == SchemeKind::serial_implicit)
        from.receives.insert(from.receives.end(), {"end_displacement", "end_velocity"});
    }
    if (interface.to.participant == participant) {
      auto& to = use(interface.to.surface);
      to.receives = {"force"};
      if (moves) to.sends = {"displacement", "velocity"};
    }
  }
  return uses;
}

protocol::Run Crew::run_for(const ParticipantCase& participant) const {
  protocol::Run run;
  run.tick = case_.window;
  run.end = case_.windows;
  run.window = 1;
  run.resumes = resumes_;
  run.wants_mass = case_.scheme == SchemeKind::serial_explicit || case_.scheme == SchemeKind::parallel_explicit;
  std::copy(case_.gravity.data(), case_.gravity.data() + 3, run.gravity);
  if (!results_.empty()) run.results = results_ + "/" + participant.name;
  run.uses = uses_of(case_, participant.name);
  return run;
}

Crew::Member* Crew::with_peer(const std::string& peer) {
  for (auto& [name, member] : members_)
    if (!member.peer.empty() && member.peer == peer) return &member;
  return nullptr;
}

bool Crew::all_are(Member::Phase phase) const {
  return std::all_of(members_.begin(), members_.end(),
                     [&](const auto& entry) { return entry.second.phase == phase; });
}

void Crew::fail(const Member& member, const std::string& message) const {
  throw Failure(member.about->name, state_of(member),
                fmt::format("{} ({}) {} while {}.", member.about->name, member.about->program(),
                            message, state_of(member)));
}

}  // namespace acopla::coupler
