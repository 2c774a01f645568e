#include "coupler/replay.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>

namespace acopla::coupler {
namespace {

// A results folder stands for the record in it.
std::string record_file(const std::string& given) {
  std::error_code ignored;
  return std::filesystem::is_directory(given, ignored) ? given + "/interface.h5" : given;
}

}  // namespace

Replay::Replay(const ReplayCase& replay, const std::string& name)
    : replay_(replay), name_(name), reader_(record_file(replay.file)) {
  owner_ = owner();
  if (reader_.windows() == 0)
    throw io::UserError({replay_.file, 0, 0},
                        "the record holds no window. Run the case that makes it again.");
  const double first = reader_.window(0).first, last = reader_.window(reader_.windows() - 1).second;
  from_ = replay_.from.value_or(first);
  to_ = replay_.to.value_or(last);
  const double slack = 1e-9 * std::max(std::abs(last), last - first);
  if (from_ < first - slack || to_ > last + slack || from_ >= to_)
    throw io::UserError(
        {replay_.file, 0, 0},
        fmt::format("the record reaches from {:.10g} s to {:.10g} s; {:.10g} s to {:.10g} s "
                    "is asked. Choose a part of it.",
                    first, last, from_, to_));
}

std::string Replay::owner() const {
  std::set<std::string> owners;
  for (const auto& surface : reader_.surfaces())
    owners.insert(surface.substr(0, surface.find('.')));
  if (!replay_.of.empty()) {
    if (owners.count(replay_.of)) return replay_.of;
    throw io::UserError({replay_.file, 0, 0}, fmt::format("{} is not in the record. It holds: {}.",
                                                          replay_.of, fmt::join(owners, ", ")));
  }
  if (owners.count(name_)) return name_;
  if (owners.size() == 1) return *owners.begin();
  throw io::UserError(
      {replay_.file, 0, 0},
      fmt::format("{} is not in the record, which holds {}. Say which with of = \"…\".", name_,
                  fmt::join(owners, ", ")));
}

protocol::Introduction Replay::introduce() const { return {"replay", 3, {}}; }

std::vector<protocol::Surface> Replay::start(const protocol::Run& run) {
  const auto recorded = reader_.surfaces();
  for (const auto& use : run.uses) {
    const auto full = owner_ + "." + use.surface;
    if (std::find(recorded.begin(), recorded.end(), full) == recorded.end())
      throw io::UserError({replay_.file, 0, 0},
                          fmt::format("surface {} is not in the record. It holds: {}.", full,
                                      fmt::join(recorded, ", ")));
    const auto sends = [&](const char* field) { return std::find(use.sends.begin(), use.sends.end(), field) != use.sends.end(); };
    surfaces_.push_back({use.surface, reader_.surface(full)});
    played_.push_back({use.surface, sends("force"), sends("displacement"), sends("velocity")});
    const bool speeds = played_.back().speeds;
    if (!played_.back().moves) continue;
    if (!reader_.has(full, "displacement"))
      throw io::UserError({replay_.file, 0, 0}, fmt::format("the record holds no motion of {}. Run the case that makes it with {}.", full,
                                                            speeds ? "coupling.record_motion = true" : "slides = true in its interface"));
    const double start = from_ - replay_.at;
    surfaces_.back().displacement = motion(use.surface, "displacement", start);
    if (speeds) surfaces_.back().velocity = motion(use.surface, "velocity", start);
  }
  return surfaces_;
}

protocol::Advance Replay::advance(const protocol::Window& window,
                                  const std::vector<protocol::Field>&) {
  const double shift = from_ - replay_.at;
  protocol::Advance advance;
  for (std::size_t k = 0; k < surfaces_.size(); ++k) {
    const auto& surface = surfaces_[k];
    for (const auto& [field, is_sent] : {std::pair{"displacement", played_[k].moves}, {"velocity", played_[k].speeds}})
      if (is_sent) advance.fields.push_back({surface.name, field, motion(surface.name, field, window.end_time() + shift)});
    if (!played_[k].sends) continue;
    auto force = mean_force(surface.name, surface.mesh.points.size(), window.start_time + shift,
                            window.end_time() + shift);
    geometry::Vec3 sum = geometry::Vec3::Zero();
    for (const auto& f : force) sum += f;
    if (!sum.allFinite())
      throw io::UserError({replay_.file, 0, 0}, fmt::format("the record holds no force of {} between {:.6g} s and {:.6g} s. Choose another part of it.", surface.name,
                                                            window.start_time + shift, window.end_time() + shift));
    for (int d = 0; d < 3; ++d)
      advance.quantities.emplace_back(fmt::format("{}.force.{}", surface.name, "xyz"[d]), sum[d]);
    advance.fields.push_back({surface.name, "force", std::move(force)});
  }
  return advance;
}

std::vector<geometry::Vec3> Replay::motion(const std::string& surface, const std::string& field, double time) const {
  const auto full = owner_ + "." + surface;
  const bool stands = time < from_ || time > to_;
  time = std::clamp(time, from_, to_);
  std::size_t next = 0;  // the window whose end is not before that time
  const double slack = 1e-9 * (to_ - from_);
  while (next + 1 < reader_.windows() && reader_.window(next).second < time - slack) ++next;
  const auto [start, end] = reader_.window(next);
  auto values = reader_.field(full, field, next);
  if (time < end - slack) {
    const auto before = next > 0 ? reader_.field(full, field, next - 1) : reader_.initial(full, field);
    const double share = std::clamp((time - start) / (end - start), 0.0, 1.0);
    for (std::size_t k = 0; k < values.size(); ++k) values[k] = share * values[k] + (1 - share) * before[k];
  }
  if (stands && field == "velocity") std::fill(values.begin(), values.end(), geometry::Vec3::Zero());
  return values;
}

std::vector<geometry::Vec3> Replay::mean_force(const std::string& surface, std::size_t points,
                                               double start, double end) const {
  std::vector<geometry::Vec3> mean(points, geometry::Vec3::Zero());
  const double length = end - start, slack = 1e-9 * length;
  const auto field = [&](std::size_t k) {
    return reader_.field(owner_ + "." + surface, "force", k);
  };
  for (std::size_t k = 0; k < reader_.windows(); ++k) {
    const auto [recorded_start, recorded_end] = reader_.window(k);
    const double low = std::max({start, recorded_start, from_}),
                 high = std::min({end, recorded_end, to_});
    if (high - low <= slack) continue;
    if (std::abs(recorded_start - start) <= slack && std::abs(recorded_end - end) <= slack &&
        high - low >= length - slack)
      return field(k);
    const auto recorded = field(k);
    for (std::size_t p = 0; p < std::min(points, recorded.size()); ++p)
      mean[p] += (high - low) / length * recorded[p];
  }
  return mean;
}

}  // namespace acopla::coupler
