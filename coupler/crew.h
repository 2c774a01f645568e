// The participants as the coupler sees them: who is there, what each is doing, and whether it still
// lives.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <string>
#include <vector>
#include <zmq.hpp>

#include "coupler/case.h"
#include "coupler/outcome.h"
#include "coupler/outside.h"
#include "coupler/replay.h"
#include "coupler/reporter.h"
#include "protocol/hub.h"
#include "protocol/participant.h"
#include "protocol/pulse.h"

namespace acopla::coupler {

/// What the case couples of a participant's surfaces, as its welcome says it.
std::vector<protocol::Run::Use> uses_of(const Case& read, const std::string& participant);

/// The coupler's half of the state machine (docs/protocol.md, §3). Whatever a participant does
/// wrong, and whatever befalls it, ends in a Failure that names it and its state; whatever a
/// stranger does is answered and noted.
class Crew {
 public:
  /// Binds the hub and the pulse. @param outside may be null. @throws io::UserError when the
  /// address is taken
  /// @param read  whose windows it divides, where they are in steps, once everybody has said how long its steps are
  Crew(zmq::context_t& context, const std::string& endpoint, Case& read,
       const std::string& results, Reporter& reporter, Outside* outside, bool resumes = false,
       const protocol::Keys* keys = nullptr);

  /// Waits until everybody said hello and sent its surfaces. @throws Failure, Interrupted
  void assemble();
  /// A surface of a participant, once assembled. @throws io::UserError located at `asked_at` when
  /// it has none such
  const geometry::SurfaceMesh& surface(const SurfaceName& name, const io::Location& asked_at) const;

  /// A surface's motion when coupled time begins; empty where it is at rest.
  struct Initial {
    std::vector<geometry::Vec3> displacement, velocity, mass;
  };
  /// A participant can return to the start of a window.
  bool saves(const std::string& participant) const { return members_.at(participant).saves; }
  const Initial& initial(const SurfaceName& name) const { return members_.at(name.participant).initial.at(name.surface); }

  /// Everybody named remembers its state, or returns to it. All at once; done when all have answered. @throws Failure, Interrupted
  void save(const std::vector<std::string>& participants) { ask(participants, protocol::Kind::save); }
  void restore(const std::vector<std::string>& participants) { ask(participants, protocol::Kind::restore); }

  /// Everybody writes a checkpoint into a folder, or returns to the one in it. @throws Failure, Interrupted
  void checkpoint(const std::string& folder) { ask(everybody(), protocol::Kind::checkpoint, folder); }
  void resume(const std::string& folder) { ask(everybody(), protocol::Kind::resume, folder); }
  /// What the summary tells of the participants' work.
  template <class Archive>
  void state(Archive& archive) {
    for (auto& [name, member] : members_) {
      archive(name + ".steps", member.outcome.steps);
      archive(name + ".seconds", member.outcome.seconds);
      archive(name + ".waiting", member.outcome.seconds_waiting);
    }
  }

  /// Asks a participant, which must be idle, for the windows [start, end).
  void begin_advance(const std::string& participant, std::int64_t start, std::int64_t end,
                     std::vector<protocol::Field> fields, bool estimate = false);
  struct Answer {
    std::string participant;
    protocol::Advance advance;
  };
  /// The next answer of anybody. @throws Failure, Interrupted
  Answer next_answer();
  /// To be called after the last request and before work of one's own: lets it go on its way. @throws Failure, Interrupted
  void give_way();
  /// Of those who compute one took no longer than a few milliseconds last time.
  bool answers_soon() const;

  /// Ends the run well. @return what the participants report at the end, as "participant.quantity"
  std::vector<std::pair<std::string, double>> finish();
  /// Tells everybody that the run is over and why; never throws.
  void dismiss(const std::string& why) noexcept;

  std::vector<ParticipantOutcome> outcomes() const;

 private:
  using Clock = std::chrono::steady_clock;

  struct Member {
    const ParticipantCase* about = nullptr;
    std::unique_ptr<Replay> replay;  // plays here instead of a process
    std::string peer;                // address, once it said hello
    enum class Phase {
      absent,
      introduced,  // waits for the others' hellos, since its welcome says how long windows are
      starting,
      idle,
      advancing,
      returning,  // or saving, or at a checkpoint
      finishing,
      finished
    } phase = Phase::absent;
    std::string state = "not connected";
    protocol::Window window;  // of the last advance
    double step = 0;     // the longest it takes [s]; 0: it does not say
    bool saves = false;
    std::uint64_t sequence = 0;
    std::map<std::string, geometry::SurfaceMesh> surfaces;
    std::map<std::string, Initial> initial;
    Clock::time_point since;  // of the phase
    double last_advance = 0;  // took so long [s]
    ParticipantOutcome outcome;
  };

  std::vector<std::string> everybody() const;
  void ask(const std::vector<std::string>& participants, protocol::Kind kind, const std::string& folder = {});
  void turn(std::chrono::milliseconds wait);
  void hear(protocol::Arrival arrival);
  void hear_member(Member& member, protocol::Message message);
  void hear_stranger(const protocol::Arrival& arrival);
  void welcome(Member& member);
  void divide();
  void admit(const std::string& peer, const protocol::Message& message);
  void refuse(const std::string& peer, const std::string& why);
  void take_surfaces(Member& member, std::vector<protocol::Surface> surfaces);
  void take_advance(Member& member, protocol::Advance advance);
  void take_end(Member& member, const protocol::Message& message);
  void heed(const Notice& notice);
  void hear_last_words(const std::string& peer);
  void check_health();
  static std::string state_of(const Member& member);
  void enter(Member& member, Member::Phase phase, const std::string& state);
  void request(Member& member, protocol::Message message);
  void start_replay(Member& member);
  protocol::Run run_for(const ParticipantCase& participant) const;
  Member* with_peer(const std::string& peer);
  bool all_are(Member::Phase phase) const;
  [[noreturn]] void fail(const Member& member, const std::string& message) const;

  Case& case_;
  std::string results_;
  bool resumes_;
  Reporter& reporter_;
  Outside* outside_;
  protocol::Hub hub_;
  protocol::PulseMonitor pulse_;
  std::map<std::string, Member> members_;
  std::deque<Answer> answers_;
  std::vector<std::pair<std::string, double>> last_values_;
  Clock::time_point begin_, looked_;
  int notes_left_ = 50;  // a stranger must not fill the disk with our log
};

}  // namespace acopla::coupler
