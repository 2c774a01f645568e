// One-way coupling: what one side sends loads the other, which never answers.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "coupler/account.h"
#include "coupler/case.h"
#include "coupler/crew.h"
#include "coupler/scheme.h"

namespace acopla::coupler {

/// Senders compute one window ahead of the slowest receiver, so that both sides
/// work at the same time; each window is recorded, in order, once everybody is through it.
///
/// What receivers get: `history` every window from loads_from on, with the mean force of that
/// window; `mean` one window [at − over, at] with the mean over it; `snapshot` the last window
/// before `at` alone.
class OneWay final : public Scheme {
 public:
  OneWay(const Case& read, Crew& crew, Account& account);
  void step() override;
  void write(io::StateWriter& writer) override { state(writer); }
  void read(io::StateReader& reader) override { state(reader); }

 private:
  struct Receiver {
    std::int64_t next = 0;  // span to be begun
    std::int64_t answered = 0;
  };

  template <class Archive>
  void state(Archive& archive);
  void begin_what_can_begin();
  void begin_receiver(const std::string& name, Receiver& receiver);
  void take(Crew::Answer answer);
  void map_forces(const std::string& sender, std::int64_t window, const protocol::Advance& advance);
  void note_quantities(const Crew::Answer& answer, std::int64_t window);
  bool is_complete(std::int64_t window) const;
  void close_window();

  std::int64_t span_count() const;
  std::pair<std::int64_t, std::int64_t> span(
      std::int64_t index) const;                    // first window and one past the last
  std::int64_t span_of(std::int64_t window) const;  // −1 where receivers get nothing of it

  const Case& case_;
  Crew& crew_;
  Account& account_;
  std::map<std::string, std::int64_t>
      senders_;  // windows answered; participants without a surface are senders of nothing
  std::map<std::string, bool> sender_busy_;
  std::map<std::string, Receiver> receivers_;
  std::map<std::int64_t, WindowRecord> open_;  // windows under way
  std::map<std::int64_t, std::map<std::string, std::vector<geometry::Vec3>>>
      loads_;  // span → "to" surface → forces
};

}  // namespace acopla::coupler
