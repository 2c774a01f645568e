// The rules of docs/protocol.md that a participant is examined on, and what came of each.
#pragma once

#include <array>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace acopla::conformance {

struct Rule {
  std::string_view name;
  std::string_view section;   ///< of docs/protocol.md
  std::string_view sentence;  ///< what a participant does that keeps it
};

/// In the order in which they are examined.
inline constexpr std::array rules{
    Rule{"hello", "§3", "says hello first, with all that its body must hold"},
    Rule{"version", "§7", "speaks version 1 of the protocol"},
    Rule{"dimension", "§4", "works in the dimensions of the case"},
    Rule{"interface", "§4", "answers welcome by interface, with the surfaces that are coupled, well shaped"},
    Rule{"pulse", "§5", "reports to the pulse within 10 s of welcome, in its own name"},
    Rule{"idle-pings", "§5", "answers pings while it waits for a request"},
    Rule{"order", "§3", "sends nothing that was not asked for"},
    Rule{"zero-fields", "§4", "computes a window under fields of zero"},
    Rule{"fields", "§4", "answers advance by advanced, with the fields it must send, finite and one vector a point"},
    Rule{"sequence", "§2", "gives its answer the number of the request"},
    Rule{"windows", "§4", "computes windows that follow one another"},
    Rule{"unknown-keys", "§7", "ignores keys and arrays that it does not know"},
    Rule{"unsupported", "§3", "answers what it cannot do by error with `unsupported` true, and goes on"},
    Rule{"restore", "§4", "computes a window again after restore, bit for bit"},
    Rule{"restore-again", "§4", "restores several times for one save, whatever it was given in between, and saves anew"},
    Rule{"checkpoint", "§4", "goes on as before after checkpoint, and bit for bit the same in a new process after resume"},
    Rule{"busy-pings", "§5", "answers pings while it computes"},
    Rule{"finish", "§3", "answers finish by done"},
    Rule{"exit", "§3", "ends with exit code 0 after finish"},
    Rule{"before-welcome", "§3", "ends with an error when a request comes before welcome"},
    Rule{"out-of-turn", "§3", "ends with an error when a message comes that its state does not allow"},
    Rule{"not-finite", "§3", "ends with an error when a field holds a NaN"},
    Rule{"wrong-points", "§3", "ends with an error when a field has another number of points than its surface"},
    Rule{"malformed", "§2", "ends with an error when bytes come that are no message"},
    Rule{"wrong-bytes", "§2", "ends with an error when an array has other bytes than its shape asks for"},
    Rule{"other-version", "§7", "ends with an error when a request is of another version"},
    Rule{"shared-memory", "§8", "computes the same from arrays in shared memory, where it said that it found it"},
    Rule{"refusal", "§3", "ends when it is refused"},
    Rule{"end-of-run", "§3", "ends without an answer when the coupler says error"},
    Rule{"silence", "§5", "ends by itself when no ping comes for 10 s"},
};

enum class Verdict { unreached, kept, broken, passed_over };

struct Finding {
  Verdict verdict = Verdict::unreached;
  std::string text;  ///< what it did instead; or why the rule does not apply
};

class Report {
 public:
  void keep(std::string_view rule) { findings_[rule] = {Verdict::kept, ""}; }
  void note_broken(std::string_view rule, std::string text) { findings_[rule] = {Verdict::broken, std::move(text)}; }
  void pass_over(std::string_view rule, std::string why) { findings_[rule] = {Verdict::passed_over, std::move(why)}; }
  const Finding& of(std::string_view rule) const;
  std::size_t count(Verdict verdict) const;
  /// One line a rule, and a last one with the counts.
  std::string text() const;

 private:
  std::map<std::string_view, Finding> findings_;
};

}  // namespace acopla::conformance
