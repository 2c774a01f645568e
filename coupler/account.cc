#include "coupler/account.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "coupler/failure.h"
#include "coupler/mapping/share.h"

namespace acopla::coupler {

using geometry::Vec3;

Account::Account(const Case& read, Crew& crew, Record& record, Quantities& quantities,
                 Reporter& reporter)
    : case_(read), crew_(crew), record_(record), quantities_(quantities), reporter_(reporter) {
  for (const auto& interface : case_.interfaces) link(interface);
  for (std::size_t k = 0; k < links_.size(); ++k) share(k);
  for (auto& link : links_) {
    if (link.to) map(link);
    link.centre = link.from->centroid();
    for (const auto& other : links_) link.alone = link.alone && (&other == &link || !other.mapping || !(other.about->to == link.about->to));
  }
}

void Account::link(const InterfaceCase& interface) {
  Link link;
  link.about = &interface;
  link.from = &crew_.surface(interface.from, interface.from_at);
  if (interface.recorded_only()) {
    record_.add_surface(interface.from.text(), *link.from);
    interfaces_.push_back({interface.text(), Vec3::Zero(), Vec3::Zero(), 0, 0});
    links_.push_back(std::move(link));
    return;
  }
  link.to = &crew_.surface(interface.to, interface.to_at);
  if (link.to->face_count() == 0 && interface.mapping != MappingKind::nearest)
    throw io::UserError(interface.to_at, fmt::format("surface {} has no faces to receive forces. Give it some, or take mapping = \"nearest\".",
                                                     interface.to.text()));
  if (link.from->face_count() == 0 && interface.mapping == MappingKind::overlap)
    throw io::UserError(interface.from_at, fmt::format("surface {} has no faces that could lie over those of {}. Take mapping = \"conservative\".",
                                                       interface.from.text(), interface.to.text()));
  record_.add_surface(interface.from.text(), *link.from);
  record_.add_surface(interface.to.text(), *link.to);
  if (interface.slides) {
    const auto& initial = crew_.initial(interface.from).displacement;
    link.travel = std::make_unique<Travel>(interface, *link.from, case_.dimension, initial);
    record_.set_initial(interface.from.text(), initial.empty() ? std::vector<Vec3>(link.from->points.size(), Vec3::Zero()) : initial, {});
  }
  interfaces_.push_back({interface.text(), Vec3::Zero(), Vec3::Zero(), 0, 0});
  links_.push_back(std::move(link));
}

// Interfaces of one table share the points of the surface they come from: all of them at the first.
void Account::share(std::size_t first) {
  const auto group = links_[first].about->share;
  if (group == 0 || (first > 0 && links_[first - 1].about->share == group)) return;
  std::vector<const geometry::SurfaceMesh*> receivers;
  for (auto k = first; k < links_.size() && links_[k].about->share == group; ++k) receivers.push_back(links_[k].to);
  for (auto& own : share_points(links_[first].place(), receivers, case_.max_distance)) links_[first++].own = std::move(own);
}

void Account::map(Link& link) {
  const auto& interface = *link.about;
  link.mapping = std::make_unique<Mapping>(link.place(), *link.to, MappingOptions{case_.max_distance, interface.mapping, link.own});
  if (interface.slides) return;  // it may begin beside the receiver, and leave it: the ledger has what is lost
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
  if (mapping.uncovered() > 0)
    reporter_.note(fmt::format("{}: {} of {} points of {} have no face of {} over those around them, and load the nearest.", interface.at.text(), mapping.uncovered(),
                               link.from->points.size(), interface.from.text(), interface.to.text()));
}

// Only interfaces that slide are followed; while their surface stands its mapping stays.
void Account::follow(const std::string& sender, protocol::Advance& advance, WindowRecord& window) {
  const auto follows = [&](const Link& link) { return link.travel && link.about->from.participant == sender; };
  for (auto& link : links_) {
    if (!follows(link)) continue;
    auto& displacement = window.motion[link.about->from.text()].displacement;
    for (auto& field : advance.fields)
      if (field.name == "displacement" && field.surface == link.about->from.surface && displacement.empty()) displacement = std::move(field.values);
    link.travel->go_on(displacement);
  }
  const auto is_elsewhere = [&](const Link& link) { return follows(link) && link.travel->has_moved(); };
  for (std::size_t k = 0; k < links_.size(); ++k)
    if (is_elsewhere(links_[k])) share(k);
  for (auto& link : links_)
    if (is_elsewhere(link)) map(link);
}

std::vector<Vec3> Link::carried(std::span<const Vec3> forces) const {
  auto all = travel ? travel->turned(forces) : std::vector<Vec3>(forces.begin(), forces.end());
  for (std::size_t k = 0; k < own.size(); ++k)
    if (!own[k]) all[k].setZero();
  return all;
}

void Account::map_forces(const std::string& sender, protocol::Advance& advance, WindowRecord& window, Forces& received) {
  follow(sender, advance, window);
  for (auto& field : advance.fields)
    if (field.name == "force") window.forces[sender + "." + field.surface] = std::move(field.values);
  for (std::size_t k = 0; k < links_.size(); ++k) {
    const auto& link = links_[k];
    if (!link.mapping || link.about->from.participant != sender) continue;
    const auto& own = window.forces.at(link.about->from.text());
    const auto turned = link.travel ? link.travel->turned(own) : std::vector<Vec3>();
    const auto& sent = link.travel ? turned : own;
    auto& load = received[link.about->to.text()];
    if (link.alone) {
      load.resize(link.to->points.size());
      link.mapping->forces(sent, load);
      continue;
    }
    window.arrived.resize(links_.size());
    auto& part = window.arrived[k];
    part.resize(link.to->points.size());
    link.mapping->forces(sent, part);
    if (load.empty()) load.assign(part.size(), Vec3::Zero());
    for (std::size_t n = 0; n < part.size(); ++n) load[n] += part[n];
  }
}

const std::vector<Vec3>& Account::arrived(std::size_t interface, const WindowRecord& window, const Forces& received) const {
  return links_[interface].alone ? received.at(links_[interface].about->to.text()) : window.arrived[interface];
}

void Account::balance(const std::string& sender, WindowRecord& window, const Forces& received) const {
  window.ledger.resize(links_.size());
  for (std::size_t k = 0; k < links_.size(); ++k) {
    const auto& link = links_[k];
    if (link.about->from.participant != sender) continue;
    auto& row = window.ledger[k];
    const auto& forces = window.forces.at(link.about->from.text());
    const bool all_as_they_are = link.own.empty() && !link.travel;
    row.sent = resultant(link.place().points, all_as_they_are ? forces : link.carried(forces), link.centre);
    row.received = row.sent;
    if (!link.mapping) continue;
    row.received = resultant(link.to->points, arrived(k, window, received), link.centre);
    row.loss = loss(row.sent, row.received);
    row.unmapped = link.mapping->unmapped();
    row.worst_distance = link.mapping->worst_distance();
  }
}

void Account::begin() { begin_ = std::chrono::steady_clock::now(); }

void Account::close(WindowRecord& window) {
  window.ledger.resize(links_.size());
  std::int64_t unmapped = 0;
  for (std::size_t k = 0; k < links_.size(); ++k) {
    const auto& row = window.ledger[k];
    unmapped += static_cast<std::int64_t>(row.unmapped);
    ledgers_.worst_distance = std::max(ledgers_.worst_distance, row.worst_distance);
    auto& outcome = interfaces_[k];
    outcome.sent = row.sent.force;
    outcome.received = row.received.force;
    outcome.loss = row.loss.force;
    outcome.worst_loss = std::max(outcome.worst_loss, row.loss.force);
    ledgers_.force_loss = std::max(ledgers_.force_loss, row.loss.force);
    ledgers_.moment_loss = std::max(ledgers_.moment_loss, row.loss.moment);
    ledgers_.energy_made += row.work_received - row.work_sent;
  }
  ledgers_.unmapped = std::max(ledgers_.unmapped, unmapped);
  ledgers_.iterations += window.iterations;
  ledgers_.most_iterations = std::max(ledgers_.most_iterations, window.iterations);
  ledgers_.not_converged += window.converged ? 0 : 1;
  ledgers_.jumped += window.jumped ? 1 : 0;
  window.energy_made = ledgers_.energy_made;
  record_.write(complete_, window);
  const double end = case_.time(complete_ + window.ticks);
  for (const auto& [name, value] : window.quantities) quantities_.add(name, end, value);
  complete_ += window.ticks;
  ++rows_;
  seconds_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
  reporter_.progress(complete_, case_.windows, end, seconds_);
  check_limits(window);
}

// Losses are compared so that NaN, which no comparison holds for, is beyond every limit.
void Account::check_limits(const WindowRecord& window) const {
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
  if (const auto limit = case_.limits.energy_made; limit && !(std::abs(window.energy_made) <= *limit))
    throw Failure("coupler", "coupling",
                  fmt::format("the coupling made {:.4g} J until {:.6g} s; coupling.limits.energy_made = {:.4g}. Shorten the window, or use "
                              "scheme = \"implicit\".",
                              window.energy_made, case_.time(complete_), *limit),
                  Failure::Cause::limit);
}

}  // namespace acopla::coupler
