// One-way coupling: what one side sends loads the other, which never answers.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "coupler/account.h"
#include "coupler/case.h"
#include "coupler/crew.h"
#include "coupler/load_filter.h"
#include "coupler/scheme.h"

namespace acopla::coupler {

/// Senders compute one window ahead of the slowest receiver, so that both sides
/// work at the same time; each window is recorded, in order, once everybody is through it.
///
/// What receivers get is for LoadFilter to say.
class OneWay final : public Scheme {
 public:
  OneWay(const Case& read, Crew& crew, Account& account);
  void step() override;
  void write(io::StateWriter& writer) override;
  void read(io::StateReader& reader) override;

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
  void map_forces(const std::string& sender, std::int64_t window, protocol::Advance& advance);
  void pass_on();
  void note_quantities(const Crew::Answer& answer, std::int64_t window);
  bool is_complete(std::int64_t window) const;
  void close_window();

  const Case& case_;
  Crew& crew_;
  Account& account_;
  std::map<std::string, std::int64_t>
      senders_;  // windows answered; participants without a surface are senders of nothing
  std::map<std::string, bool> sender_busy_;
  std::map<std::string, Receiver> receivers_;
  std::map<std::int64_t, WindowRecord> open_;  // windows under way
  std::map<std::int64_t, Account::Forces> mapped_;  // window → "to" surface → forces, until all senders have sent theirs
  LoadFilter loads_;
};

}  // namespace acopla::coupler
