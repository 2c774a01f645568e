#include "conformance/examination.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <thread>

#include "protocol/codec.h"
#include "protocol/pulse.h"

namespace acopla::conformance {
namespace {

using protocol::Kind;
using protocol::Message;
using namespace std::chrono_literals;

constexpr auto idle_time = 2000ms;   // longer than a participant may be silent
constexpr auto silence_limit = 15000ms;  // ten seconds, and some for looking at the clock

double seconds(std::chrono::milliseconds time) { return static_cast<double>(time.count()) / 1000; }

bool same_bits(const Message& a, const Message& b) {
  if (a.body != b.body || a.values != b.values || a.arrays.size() != b.arrays.size()) return false;
  for (std::size_t k = 0; k < a.arrays.size(); ++k) {
    const auto one = a.arrays[k].bytes(), other = b.arrays[k].bytes();
    if (a.arrays[k].name() != b.arrays[k].name() || a.arrays[k].mesh() != b.arrays[k].mesh() ||
        !std::equal(one.begin(), one.end(), other.begin(), other.end()))
      return false;
  }
  return true;
}

// What differs first, in a sentence.
std::string difference(const Message& a, const Message& b) {
  for (const auto& array : a.arrays) {
    const auto* other = b.find(array.name(), array.mesh());
    if (!other) return fmt::format("{} on {} is missing", array.name(), array.mesh());
    if (array.type() != protocol::ArrayType::f8 || other->type() != protocol::ArrayType::f8) continue;
    const auto x = array.doubles(), y = other->doubles();
    for (std::size_t k = 0; k < std::min(x.size(), y.size()); ++k)
      if (x[k] != y[k])
        return fmt::format("{} on {} differs at point {}: {:.17g} and {:.17g}", array.name(), array.mesh(), k / 3, x[k], y[k]);
  }
  for (std::size_t k = 0; k < std::min(a.values.size(), b.values.size()); ++k)
    if (a.values[k] != b.values[k])
      return fmt::format("its values differ: {} = {:.17g} and {} = {:.17g}", a.values[k].first, a.values[k].second, b.values[k].first, b.values[k].second);
  if (a.values.size() != b.values.size()) return fmt::format("its values differ: {} and {} of them", a.values.size(), b.values.size());
  if (a.body != b.body) return fmt::format("its values differ: {} and {}", a.body.dump(), b.body.dump());
  return "its arrays differ";
}

std::vector<std::string> frames_of(const Message& message) {
  std::vector<std::string> frames{protocol::encode_header(message)};
  for (const auto& array : message.arrays) frames.emplace_back(reinterpret_cast<const char*>(array.bytes().data()), array.bytes().size());
  return frames;
}

class Examination {
 public:
  Examination(Subject& subject, const Plan& plan) : subject_(subject), plan_(plan) {}

  Report run() {
    scene("hello", [this] { whole_run(); });
    if (report_.of("windows").verdict != Verdict::kept) return report_;  // the rest would only repeat it
    if (can("checkpoint")) scene("checkpoint", [this] { resumed_run(); });
    else if (can_known_) report_.pass_over("checkpoint", "it does not offer \"checkpoint\"");
    scene("before-welcome", [this] { request_before_welcome(); });
    ends_with_error("out-of-turn", "an interface from the coupler", [this](Rehearsal& stage) { say_interface(stage); });
    if (receives_) {
      ends_with_error("not-finite", "a field with a NaN", [](Rehearsal& stage) {
        auto fields = stage.zero_fields();
        if (!fields.empty() && !fields.front().values.empty()) fields.front().values.back()[1] = std::numeric_limits<double>::quiet_NaN();
        stage.say(stage.advance_request(0, fields));
      });
      ends_with_error("wrong-points", "a field with a point too many", [](Rehearsal& stage) {
        auto fields = stage.zero_fields();
        fields.front().values.emplace_back(0, 0, 0);
        stage.say(stage.advance_request(0, fields));
      });
      ends_with_error("wrong-bytes", "an array that is shorter than its shape", [](Rehearsal& stage) {
        auto frames = frames_of(stage.advance_request(0, stage.zero_fields()));
        frames.back().resize(frames.back().size() - 3);
        stage.say_bytes(frames);
      });
    } else {
      for (const char* rule : {"not-finite", "wrong-points", "wrong-bytes"}) report_.pass_over(rule, "it receives no fields");
    }
    ends_with_error("malformed", "bytes that are no message", [](Rehearsal& stage) { stage.say_bytes({"\xc1 no message"}); });
    ends_with_error("other-version", "a request of version 2", [](Rehearsal& stage) {
      auto frames = frames_of(stage.advance_request(0, stage.zero_fields()));
      frames.front()[8] = 2;  // 85 a6 "acopla" 01: the first value of the map (docs/protocol.md, §9)
      stage.say_bytes(frames);
    });
    scene("shared-memory", [this] { shared_memory(); });
    scene("refusal", [this] { refused(); });
    scene("end-of-run", [this] { dismissed(); });
    if (plan_.examines_silence) scene("silence", [this] { left_alone(); });
    else report_.pass_over("silence", "it takes 10 s, which --quick leaves out");
    return report_;
  }

 private:
  // Runs one life of the participant; what it breaks is booked on the rule that is being examined.
  void scene(std::string_view first, const std::function<void()>& act) {
    rule_ = first;
    try {
      act();
    } catch (const Broken& broken) {
      report_.note_broken(broken.rule().empty() ? rule_ : broken.rule(), broken.what());
    } catch (const protocol::ProtocolError& error) {
      report_.note_broken(rule_, fmt::format("sent a message that cannot be used: {}", error.what()));
    }
  }
  void examine(std::string_view rule) { rule_ = rule; }
  void keep() { report_.keep(rule_); }
  bool can(const char* capability) const { return std::find(capabilities_.begin(), capabilities_.end(), capability) != capabilities_.end(); }

  void whole_run() {
    Rehearsal stage(subject_, plan_);
    start(stage);
    wait_idle(stage);
    examine("zero-fields");
    const auto first = stage.advance(0, stage.zero_fields());
    keep();
    examine("fields");
    check_fields(first);
    keep();
    report_.keep("sequence");  // every answer's number is checked as it comes
    examine("windows");
    by_frames_ = stage.advance(1, stage.small_fields(1));
    check_fields(stage.advance(2, stage.zero_fields()));
    keep();
    examine("unknown-keys");
    strange_window(stage);
    keep();
    unsupported(stage);
    if (can("save")) restore(stage);
    else
      for (const char* rule : {"restore", "restore-again"}) report_.pass_over(rule, "it does not offer \"save\"");
    busy_pings(stage);
    finish(stage);
  }

  void start(Rehearsal& stage) {
    const auto hello = stage.hear_hello();
    keep();
    capabilities_ = hello.introduction.capabilities;
    can_known_ = true;
    examine("version");
    if (hello.version_low > protocol::version || hello.version_high < protocol::version)
      throw Broken(fmt::format("speaks versions {} to {}, not {}", hello.version_low, hello.version_high, protocol::version));
    keep();
    examine("dimension");
    if (hello.introduction.dimension != plan_.dimension)
      throw Broken(fmt::format("works in {} dimensions, the case has {}", hello.introduction.dimension, plan_.dimension));
    keep();
    examine("interface");
    stage.say_welcome(true);
    const auto surfaces = stage.hear_interface();
    for (const auto& surface : surfaces) points_of_[surface.name] = surface.mesh.points.size();
    for (const auto& use : plan_.run.uses)
      if (std::none_of(surfaces.begin(), surfaces.end(), [&](const auto& surface) { return surface.name == use.surface; }))
        throw Broken(fmt::format("does not offer the surface \"{}\", which is coupled", use.surface));
    for (const auto& use : plan_.run.uses)
      for (const auto& surface : surfaces)
        if (surface.name == use.surface && std::find(use.receives.begin(), use.receives.end(), "force") != use.receives.end() && surface.mesh.face_count() == 0)
          throw Broken(fmt::format("offers {} without faces, though it receives forces there: they could not be mapped", surface.name));
    keep();
    receives_ = stage.receives();
    examine("pulse");
    const auto until = std::chrono::steady_clock::now() + protocol::report_limit;
    while (!stage.pulse().reported() && std::chrono::steady_clock::now() < until && stage.pulse().fault().empty()) std::this_thread::sleep_for(20ms);
    if (!stage.pulse().fault().empty()) throw Broken(stage.pulse().fault());
    if (!stage.pulse().reported()) throw Broken("never reported to the pulse whose address is in welcome");
    if (*stage.pulse().reported() != plan_.participant)
      throw Broken(fmt::format("reports to the pulse as \"{}\", and its name is \"{}\"", *stage.pulse().reported(), plan_.participant));
    keep();
  }

  void wait_idle(Rehearsal& stage) {
    examine("order");
    stage.pulse().mark();
    if (const auto what = stage.hear_anything(idle_time)) throw Broken(fmt::format("sent {} without being asked", *what));
    keep();
    examine("idle-pings");
    if (stage.pulse().longest_silence() > protocol::ping_limit) {  // once may be the machine's fault
      stage.pulse().mark();
      if (const auto what = stage.hear_anything(idle_time)) throw Broken(fmt::format("sent {} without being asked", *what), "order");
    }
    if (stage.pulse().longest_silence() > protocol::ping_limit)
      report_.note_broken(rule_, fmt::format("did not answer pings for more than {:.2g} s while it waited for a request. Answer them from a thread and "
                                             "a socket of its own", seconds(protocol::ping_limit)));
    else
      keep();
    stage.pulse().mark();
  }

  void check_fields(const Message& message) {
    const auto answer = protocol::read_advanced(message);
    for (const auto& field : answer.fields)
      if (!points_of_.contains(field.surface))
        throw Broken(fmt::format("sent {} on {}, a surface it never offered", field.name, field.surface));
    for (const auto& use : plan_.run.uses)
      for (const auto& wanted : use.sends) {
        const auto found = std::find_if(answer.fields.begin(), answer.fields.end(),
                                        [&](const auto& field) { return field.surface == use.surface && field.name == wanted; });
        if (found == answer.fields.end()) throw Broken(fmt::format("did not send {} on {}", wanted, use.surface));
        const auto points = points_of_.at(use.surface);
        if (found->values.size() != points)
          throw Broken(fmt::format("sent {} on {} with {} values for {} points", wanted, use.surface, found->values.size(), points));
      }
  }

  void strange_window(Rehearsal& stage) {
    auto request = stage.advance_request(3, stage.zero_fields());
    request.body["of_a_later_release"] = "nobody knows";
    for (const auto& use : plan_.run.uses)
      request.arrays.push_back(protocol::Array::of("of_a_later_release", use.surface, {2}, std::vector<std::uint8_t>{1, 2}));
    stage.ask(std::move(request), Kind::advanced);
  }

  void unsupported(Rehearsal& stage) {
    examine("unsupported");
    std::vector<Kind> cannot;
    if (!can("save")) cannot.insert(cannot.end(), {Kind::save, Kind::restore});
    if (!can("checkpoint")) cannot.insert(cannot.end(), {Kind::checkpoint, Kind::resume});
    if (cannot.empty()) return report_.pass_over(rule_, "it offers everything");
    for (const auto kind : cannot) {
      auto request = protocol::folder_message(kind, plan_.scratch);
      const auto answer = stage.ask(std::move(request));
      if (answer.kind != Kind::error)
        throw Broken(fmt::format("answered {} by {}, though it does not offer it", protocol::name_of(kind), protocol::name_of(answer.kind)));
      if (!protocol::read_error(answer).unsupported) throw Broken(fmt::format("answered {} by an error without `unsupported`, which ends a run", protocol::name_of(kind)));
    }
    stage.advance(next_++, stage.zero_fields());
    keep();
  }

  void restore(Rehearsal& stage) {
    examine("restore");
    const auto window = next_;
    stage.ask(Kind::save, Kind::done);
    const auto given = stage.small_fields(2);
    const auto first = stage.advance(window, given);
    stage.ask(Kind::restore, Kind::done);
    if (const auto again = stage.advance(window, given); !same_bits(first, again))
      throw Broken(fmt::format("computed a window otherwise after restore: {}", difference(first, again)));
    keep();
    examine("restore-again");
    stage.ask(Kind::restore, Kind::done);
    stage.advance(window, stage.small_fields(3));
    stage.advance(window + 1, stage.small_fields(4));
    stage.ask(Kind::restore, Kind::done);
    if (const auto again = stage.advance(window, given); !same_bits(first, again))
      throw Broken(fmt::format("computed a window otherwise after other fields and a second restore: {}", difference(first, again)));
    stage.ask(Kind::save, Kind::done);
    const auto second = stage.advance(window + 1, given);
    stage.ask(Kind::restore, Kind::done);
    if (const auto again = stage.advance(window + 1, given); !same_bits(second, again))
      throw Broken(fmt::format("did not return to the second save but elsewhere: {}", difference(second, again)));
    keep();
    next_ = window + 2;
  }

  void busy_pings(Rehearsal& stage) {
    examine("busy-pings");
    if (report_.of("idle-pings").verdict == Verdict::broken) return report_.pass_over(rule_, "it does not even answer those that come while it waits");
    if (const auto silence = stage.pulse().longest_silence(); silence > protocol::ping_limit)
      throw Broken(fmt::format("did not answer pings for more than {:.2g} s while it computed. Answer them from a thread and a socket of its own",
                               seconds(protocol::ping_limit)));
    if (stage.longest_window() < protocol::ping_limit)
      return report_.pass_over(rule_, fmt::format("its longest window took {:.2g} s; one of {:.2g} s would show it (--window)", seconds(stage.longest_window()),
                                                  seconds(protocol::ping_limit)));
    keep();
  }

  void finish(Rehearsal& stage) {
    examine("finish");
    stage.ask(Kind::finish, Kind::done);
    keep();
    examine("exit");
    const auto ending = stage.hear_its_end("finish");
    if (ending.killed || ending.code != 0) throw Broken(fmt::format("{} after finish", ending.how));
    keep();
  }

  // Windows 0, 1, checkpoint, 2 in one process; resume, 2 in another.
  void resumed_run() {
    Message expected;
    Rehearsal::Fields given;
    {
      Rehearsal stage(subject_, plan_);
      stage.open();
      given = stage.small_fields(6);
      stage.advance(0, stage.zero_fields());
      stage.advance(1, stage.small_fields(5));
      stage.ask(protocol::folder_message(Kind::checkpoint, plan_.scratch), Kind::done);
      expected = stage.advance(2, given);
    }  // it is killed: a run that must be resumed did not end well
    Rehearsal stage(subject_, plan_);
    stage.open(false, true);
    stage.ask(protocol::folder_message(Kind::resume, plan_.scratch), Kind::done);
    if (const auto resumed = stage.advance(2, given); !same_bits(expected, resumed))
      throw Broken(fmt::format("computed the window after resume otherwise: {}", difference(expected, resumed)));
    keep();
  }

  // The first windows of whole_run() once more, in another process.
  void shared_memory() {
    Rehearsal stage(subject_, plan_);
    stage.hear_hello();
    stage.say_welcome_with_memory();
    stage.hear_interface();
    if (!stage.shares_memory()) return report_.pass_over(rule_, "it does not say that it found it, which nobody must");
    // Beside an array that nobody knows and that is long enough, short ones lie in memory too.
    const auto request = [&](std::int64_t window, const Rehearsal::Fields& fields) {
      auto message = stage.advance_request(window, fields);
      message.arrays.push_back(protocol::Array::of("of_a_later_release", "nowhere", {1 << 16}, std::vector<std::uint8_t>(1 << 16, 1)));
      return message;
    };
    stage.ask(request(0, stage.zero_fields()), Kind::advanced);
    const auto answer = stage.ask(request(1, stage.small_fields(1)), Kind::advanced);
    check_fields(answer);
    if (!same_bits(by_frames_, answer))
      throw Broken(fmt::format("computed a window otherwise from arrays in shared memory: {}", difference(by_frames_, answer)));
    keep();
  }

  void request_before_welcome() {
    Rehearsal stage(subject_, plan_);
    stage.hear_hello();
    Message request;
    request.kind = Kind::finish;
    stage.say(request);
    stage.hear_its_error("finish before welcome");
    keep();
  }

  void ends_with_error(const char* rule, const char* cause, const std::function<void(Rehearsal&)>& provoke) {
    scene(rule, [&] {
      Rehearsal stage(subject_, plan_);
      stage.open();
      provoke(stage);
      stage.hear_its_error(cause);
      keep();
    });
  }

  void say_interface(Rehearsal& stage) { stage.say(protocol::interface_message({})); }

  void refused() {
    Rehearsal stage(subject_, plan_);
    stage.hear_hello();
    stage.say(protocol::error_message("this is the conformance kit, which refuses everybody once", "refused"));
    expect_quiet_end(stage, "it was refused");
  }

  void dismissed() {
    Rehearsal stage(subject_, plan_);
    stage.open();
    stage.say(protocol::error_message("somebody else failed", "ending"));
    expect_quiet_end(stage, "the coupler said error");
  }

  void expect_quiet_end(Rehearsal& stage, const std::string& cause) {
    if (const auto what = stage.hear_anything(500ms)) throw Broken(fmt::format("sent {} after {}", *what, cause));
    const auto ending = stage.hear_its_end(cause);
    if (ending.killed) throw Broken(fmt::format("{} after {}", ending.how, cause));
    keep();
  }

  void left_alone() {
    auto patient = plan_;
    patient.exit_limit = silence_limit;
    Rehearsal stage(subject_, patient, false);
    stage.open();
    stage.hear_its_end("the last ping");
    keep();
  }

  Subject& subject_;
  const Plan& plan_;
  Report report_;
  std::string_view rule_;
  std::vector<std::string> capabilities_;
  bool can_known_ = false, receives_ = false;
  std::map<std::string, std::size_t> points_of_;
  Message by_frames_;  // the answer to window 1, without shared memory
  std::int64_t next_ = 4;  // the window after those of whole_run()
};

}  // namespace

Report examine(Subject& subject, const Plan& plan) { return Examination(subject, plan).run(); }

}  // namespace acopla::conformance
