#include "coupler/one_way.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "coupler/failure.h"

namespace acopla::coupler {

using geometry::Vec3;

namespace {

// Windows a sender may be ahead: one under way on either side keeps both busy, and no more need be
// kept in memory.
constexpr std::int64_t lead = 2;

const std::vector<Vec3>& force_on(const protocol::Advance& advance, const std::string& surface) {
  for (const auto& field : advance.fields)
    if (field.surface == surface && field.name == "force") return field.values;
  throw std::logic_error("a crew answer without its force");  // Crew refuses those
}

}  // namespace

OneWay::OneWay(const Case& read, Crew& crew, Record& record, Quantities& quantities,
               Reporter& reporter)
    : case_(read), crew_(crew), record_(record), quantities_(quantities), reporter_(reporter) {
  for (const auto& participant : case_.participants) {
    if (case_.receives(participant.name))
      receivers_[participant.name];
    else
      senders_[participant.name] = 0;
  }
  for (const auto& interface : case_.interfaces) build(interface);
}

void OneWay::build(const InterfaceCase& interface) {
  Interface link{&interface, &crew_.surface(interface.from, interface.from_at), nullptr, nullptr};
  if (interface.recorded_only()) {
    record_.add_surface(interface.from.text(), *link.from);
    record_.set_mapping(links_.size(), 0, 0);
    interfaces_.push_back({interface.text(), Vec3::Zero(), Vec3::Zero(), 0, 0});
    links_.push_back(std::move(link));
    return;
  }
  link.to = &crew_.surface(interface.to, interface.to_at);
  if (link.to->face_count() == 0)
    throw io::UserError(interface.to_at, fmt::format("surface {} has no faces to receive forces.",
                                                     interface.to.text()));
  link.mapping =
      std::make_unique<Mapping>(*link.from, *link.to, MappingOptions{case_.max_distance});
  const auto& mapping = *link.mapping;
  if (static_cast<std::int64_t>(mapping.unmapped()) > case_.limits.unmapped) {
    const auto& point = link.from->points[mapping.unmapped_points().front()];
    throw io::UserError(
        interface.at,
        fmt::format("{} of {} points of {} are farther than max_distance = {:.6g} m from {}, e.g. "
                    "({:.6g}, {:.6g}, {:.6g}). "
                    "Check that the surfaces stand in the same place and unit, raise "
                    "coupling.max_distance, or allow that "
                    "many in coupling.limits.unmapped.",
                    mapping.unmapped(), link.from->points.size(), interface.from.text(),
                    case_.max_distance, interface.to.text(), point[0], point[1], point[2]));
  }
  ledgers_.unmapped += static_cast<std::int64_t>(mapping.unmapped());
  ledgers_.worst_distance = std::max(ledgers_.worst_distance, mapping.worst_distance());
  record_.add_surface(interface.from.text(), *link.from);
  record_.add_surface(interface.to.text(), *link.to);
  record_.set_mapping(links_.size(), mapping.unmapped(), mapping.worst_distance());
  interfaces_.push_back({interface.text(), Vec3::Zero(), Vec3::Zero(), 0, 0});
  links_.push_back(std::move(link));
}

void OneWay::run() {
  begin_ = std::chrono::steady_clock::now();
  while (complete_ < case_.windows) {
    begin_what_can_begin();
    take(crew_.next_answer());
    while (complete_ < case_.windows && is_complete(complete_)) close_window();
  }
}

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
    if (sender_busy_[name] || answered >= std::min(case_.windows, complete_ + lead)) continue;
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

void OneWay::map_forces(const std::string& sender, std::int64_t window,
                        const protocol::Advance& advance) {
  auto& record = open_[window];
  record.ledger.resize(links_.size());
  for (std::size_t k = 0; k < links_.size(); ++k) {
    const auto& link = links_[k];
    if (link.about->from.participant != sender) continue;
    const auto& sent = force_on(advance, link.about->from.surface);
    record.forces[link.about->from.text()] = sent;
    const Vec3 centre = link.from->centroid();
    auto& row = record.ledger[k];
    row.sent = resultant(link.from->points, sent, centre);
    if (!link.mapping) {
      row.received = row.sent;
      continue;
    }
    std::vector<Vec3> received(link.to->points.size());
    link.mapping->forces(sent, received);
    row.received = resultant(link.to->points, received, centre);
    row.loss = loss(row.sent, row.received);
    add_to_load(link, window, received);
  }
}

// Several interfaces may end on one surface, and a load may be the mean of several windows.
void OneWay::add_to_load(const Interface& link, std::int64_t window,
                         const std::vector<Vec3>& forces) {
  const auto index = span_of(window);
  if (index < 0) return;
  const auto [start, end] = span(index);
  const double share = 1.0 / static_cast<double>(end - start);
  auto& load = loads_[index][link.about->to.text()];
  if (load.empty()) load.assign(forces.size(), Vec3::Zero());
  for (std::size_t k = 0; k < forces.size(); ++k) load[k] += share * forces[k];
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
  auto& window = open_[complete_];
  window.ledger.resize(links_.size());
  record_.write(complete_, window);
  const double end = case_.time(complete_ + 1);
  for (const auto& [name, value] : window.quantities) quantities_.add(name, end, value);
  for (std::size_t k = 0; k < links_.size(); ++k) {
    const auto& row = window.ledger[k];
    auto& outcome = interfaces_[k];
    outcome.sent = row.sent.force;
    outcome.received = row.received.force;
    outcome.loss = row.loss.force;
    outcome.worst_loss = std::max(outcome.worst_loss, row.loss.force);
    ledgers_.force_loss = std::max(ledgers_.force_loss, row.loss.force);
    ledgers_.moment_loss = std::max(ledgers_.moment_loss, row.loss.moment);
  }
  ++complete_;
  const auto seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
  reporter_.progress(complete_, case_.windows, end, seconds);
  check_limits(window);
  open_.erase(complete_ - 1);
  if (const auto index = span_of(complete_ - 1); index >= 0 && span(index).second == complete_)
    loads_.erase(index);
}

// Losses are compared so that NaN, which no comparison holds for, is beyond every limit.
void OneWay::check_limits(const WindowRecord& window) const {
  for (std::size_t k = 0; k < links_.size(); ++k) {
    const auto check = [&](const char* what, double value, double limit) {
      if (value <= limit) return;
      const auto state =
          fmt::format("mapping the window that ends at {:.6g} s", case_.time(complete_));
      throw Failure(
          case_.interfaces[k].text(), state,
          fmt::format(
              "{}: the mapping from {} lost {:.3g} of the {} in the window that ends at {:.6g} s; "
              "coupling.limits.{}_loss = {:.3g}.",
              case_.interfaces[k].at.text(), case_.interfaces[k].text(), value, what,
              case_.time(complete_), what, limit),
          Failure::Cause::limit);
    };
    check("force", window.ledger[k].loss.force, case_.limits.force_loss);
    check("moment", window.ledger[k].loss.moment, case_.limits.moment_loss);
  }
}

}  // namespace acopla::coupler
