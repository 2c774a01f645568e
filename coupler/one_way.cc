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
    : case_(read), crew_(crew), account_(account) {
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

// At a checkpoint everybody is through the same windows; of a mean there may be a part.
template <class Archive>
void OneWay::state(Archive& archive) {
  for (auto& [name, answered] : senders_) archive("sender." + name, answered);
  for (auto& [name, receiver] : receivers_) {
    archive("receiver." + name + ".next", receiver.next);
    archive("receiver." + name + ".answered", receiver.answered);
  }
  auto spans = static_cast<std::int64_t>(loads_.size());
  archive("spans", spans);
  auto load = loads_.begin();
  for (std::int64_t k = 0; k < spans; ++k) {
    std::int64_t index = 0;
    std::vector<std::string> surfaces;
    if constexpr (!Archive::reading) {
      index = load->first;
      for (const auto& [surface, forces] : load->second) surfaces.push_back(surface);
    }
    const auto name = "span" + std::to_string(k);
    archive(name, index);
    archive(name + ".surfaces", surfaces);
    for (const auto& surface : surfaces) archive(name + "." + surface, loads_[index][surface]);
    if constexpr (!Archive::reading) ++load;
  }
}
template void OneWay::state(io::StateWriter&);
template void OneWay::state(io::StateReader&);

std::int64_t OneWay::span_count() const {
  return case_.loads == Loads::history ? case_.windows - case_.loads_from : 1;
}

std::pair<std::int64_t, std::int64_t> OneWay::span(std::int64_t index) const {
  if (case_.loads != Loads::history) return {case_.load_start, case_.load_end};
  return {case_.loads_from + index, case_.loads_from + index + 1};
}

std::int64_t OneWay::span_of(std::int64_t window) const {
  if (case_.loads == Loads::history)
    return window >= case_.loads_from ? window - case_.loads_from : -1;
  return window >= case_.load_start && window < case_.load_end ? 0 : -1;
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
  if (receiver.next != receiver.answered || receiver.next >= span_count())
    return;  // busy, or through
  const auto [start, end] = span(receiver.next);
  for (const auto& [sender, answered] : senders_)
    if (answered < end) return;
  std::vector<protocol::Field> fields;
  for (const auto& [surface, forces] : loads_[receiver.next])
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
  } else {
    auto& receiver = receivers_.at(answer.participant);
    note_quantities(answer, span(receiver.answered).second - 1);
    ++receiver.answered;
  }
}

void OneWay::note_quantities(const Crew::Answer& answer, std::int64_t window) {
  for (const auto& [name, value] : answer.advance.quantities)
    open_[window].quantities.emplace_back(answer.participant + "." + name, value);
}

// A load may be the mean of several windows.
void OneWay::map_forces(const std::string& sender, std::int64_t window,
                        const protocol::Advance& advance) {
  std::map<std::string, std::vector<Vec3>> received;
  account_.map_forces(sender, advance, open_[window], received);
  const auto index = span_of(window);
  if (index < 0) return;
  const auto [start, end] = span(index);
  const double share = 1.0 / static_cast<double>(end - start);
  for (const auto& [surface, forces] : received) {
    auto& load = loads_[index][surface];
    if (load.empty()) load.assign(forces.size(), Vec3::Zero());
    for (std::size_t k = 0; k < forces.size(); ++k) load[k] += share * forces[k];
  }
}

bool OneWay::is_complete(std::int64_t window) const {
  for (const auto& [name, answered] : senders_)
    if (answered <= window) return false;
  for (const auto& [name, receiver] : receivers_) {
    const auto index = span_of(window);
    if (index >= 0 && span(index).second == window + 1 && receiver.answered <= index) return false;
  }
  return true;
}

void OneWay::close_window() {
  const auto window = account_.complete();
  account_.close(open_[window]);
  open_.erase(window);
  if (const auto index = span_of(window); index >= 0 && span(index).second == window + 1)
    loads_.erase(index);
}

}  // namespace acopla::coupler
