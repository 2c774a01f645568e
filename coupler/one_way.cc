#include "coupler/one_way.h"

#include <algorithm>

namespace acopla::coupler {

using geometry::Vec3;

namespace {

// Windows a sender may be ahead: one under way on either side keeps both busy, and no more need be
// kept in memory.
constexpr std::int64_t lead = 2;

}  // namespace

OneWay::OneWay(const Case& read, Crew& crew, Account& account)
    : case_(read), crew_(crew), account_(account), loads_(read) {
  for (const auto& participant : case_.participants) {
    if (case_.receives(participant.name))
      receivers_[participant.name];
    else
      senders_[participant.name] = 0;
  }
}

void OneWay::step() {
  const auto before = account_.complete();
  while (account_.complete() == before) {
    begin_what_can_begin();
    take(crew_.next_answer());
    while (account_.complete() < case_.windows && is_complete(account_.complete())) close_window();
  }
}

// At a checkpoint everybody is through the same windows; of a load there may be a part.
template <class Archive>
void OneWay::state(Archive& archive) {
  for (auto& [name, answered] : senders_) archive("sender." + name, answered);
  for (auto& [name, receiver] : receivers_) {
    archive("receiver." + name + ".next", receiver.next);
    archive("receiver." + name + ".answered", receiver.answered);
  }
}

void OneWay::write(io::StateWriter& writer) {
  state(writer);
  loads_.write(writer);
}

void OneWay::read(io::StateReader& reader) {
  state(reader);
  loads_.read(reader);
}

void OneWay::begin_what_can_begin() {
  // Receivers first: where a sender plays in this process, beginning it takes its time.
  for (auto& [name, receiver] : receivers_) begin_receiver(name, receiver);
  for (const auto& [name, answered] : senders_) {
    if (sender_busy_[name] || answered >= std::min({case_.windows, account_.complete() + lead, case_.next_checkpoint(account_.complete())})) continue;
    sender_busy_[name] = true;
    crew_.begin_advance(name, answered, answered + 1, {});
  }
}

void OneWay::begin_receiver(const std::string& name, Receiver& receiver) {
  if (receiver.next != receiver.answered || receiver.next >= loads_.spans())
    return;  // busy, or through
  const auto [start, end] = loads_.span(receiver.next);
  for (const auto& [sender, answered] : senders_)
    if (answered < end) return;
  std::vector<protocol::Field> fields;
  for (const auto& [surface, forces] : loads_.load(receiver.next))
    if (surface.substr(0, surface.find('.')) == name) {
      fields.push_back({surface.substr(surface.find('.') + 1), "force", forces});
      open_[end - 1].forces[surface] = forces;
    }
  ++receiver.next;
  crew_.begin_advance(name, start, end, std::move(fields));
}

void OneWay::take(Crew::Answer answer) {
  if (const auto sender = senders_.find(answer.participant); sender != senders_.end()) {
    const auto window = sender->second;
    note_quantities(answer, window);
    map_forces(answer.participant, window, answer.advance);
    ++sender->second;
    sender_busy_[answer.participant] = false;
    pass_on();
  } else {
    auto& receiver = receivers_.at(answer.participant);
    note_quantities(answer, loads_.span(receiver.answered).second - 1);
    ++receiver.answered;
  }
}

void OneWay::note_quantities(const Crew::Answer& answer, std::int64_t window) {
  for (const auto& [name, value] : answer.advance.quantities)
    open_[window].quantities.emplace_back(answer.participant + "." + name, value);
}

void OneWay::map_forces(const std::string& sender, std::int64_t window, protocol::Advance& advance) {
  Account::Forces received;
  account_.map_forces(sender, advance, open_[window], received);
  account_.balance(sender, open_[window], received);
  auto& sum = mapped_[window];
  for (auto& [surface, forces] : received) {
    auto& load = sum[surface];
    if (load.empty()) {
      load = std::move(forces);
      continue;
    }
    for (std::size_t k = 0; k < forces.size(); ++k) load[k] += forces[k];
  }
}

// Whole windows, in their order, whoever sent first.
void OneWay::pass_on() {
  while (!mapped_.empty()) {
    const auto window = mapped_.begin()->first;
    for (const auto& [name, answered] : senders_)
      if (answered <= window) return;
    loads_.take(window, std::move(mapped_.begin()->second));
    mapped_.erase(mapped_.begin());
  }
}

bool OneWay::is_complete(std::int64_t window) const {
  for (const auto& [name, answered] : senders_)
    if (answered <= window) return false;
  for (const auto& [name, receiver] : receivers_) {
    const auto index = loads_.span_of(window);
    if (index >= 0 && loads_.span(index).second == window + 1 && receiver.answered <= index) return false;
  }
  return true;
}

void OneWay::close_window() {
  const auto window = account_.complete();
  account_.close(open_[window]);
  open_.erase(window);
  if (const auto index = loads_.span_of(window); index >= 0 && loads_.span(index).second == window + 1) loads_.drop(index);
}

}  // namespace acopla::coupler
