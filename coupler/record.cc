#include "coupler/record.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

namespace acopla::coupler {

using geometry::Vec3;

Record::Record(const Case& read, const std::string& folder, std::int64_t rows, std::int64_t resumes_after)
    : case_(read), folder_(folder), resumes_after_(resumes_after), kept_{rows, resumes_after} {
  if (folder_.empty()) return;
  std::filesystem::create_directories(folder_ + "/surfaces");
  const auto file = folder_ + "/interface.h5";
  series_ = resumes_after_ > 0 ? std::make_unique<io::SeriesWriter>(file, static_cast<std::size_t>(rows)) : std::make_unique<io::SeriesWriter>(file);
}

void Record::add_surface(const std::string& name, const geometry::SurfaceMesh& mesh) {
  if (!series_ || surfaces_.count(name)) return;
  series_->add_surface(name, mesh);
  surfaces_.emplace(name, mesh);
  auto& pictures = pictures_.emplace(name, io::PvdSeries(fmt::format("{}/{}.pvd", folder_, name))).first->second;
  if (resumes_after_ > 0) pictures.keep_until(case_.time(resumes_after_));
}

void Record::set_initial(const std::string& surface, std::span<const Vec3> displacement, std::span<const Vec3> velocity) {
  if (!series_) return;
  series_->add_initial(surface, "displacement", displacement);
  if (!velocity.empty()) series_->add_initial(surface, "velocity", velocity);
}

Record::~Record() {
  try {
    write_pending();
  } catch (const std::exception&) {  // a full disk was said before, or ends with the run's own failure
  }
}

void Record::write(std::int64_t index, const WindowRecord& window) {
  if (!series_) return;
  constexpr std::chrono::milliseconds pause{200};
  constexpr std::size_t most_values = 8u << 20;  // 192 MiB
  pending_.emplace_back(index, window);
  for (const auto& [name, force] : window.forces) pending_values_ += force.size();
  for (const auto& [name, motion] : window.motion) pending_values_ += motion.displacement.size() + motion.velocity.size();
  if (index + window.ticks < case_.windows && pending_values_ < most_values && std::chrono::steady_clock::now() - written_ < pause) return;
  write_pending();
}

void Record::write_pending() {
  if (pending_.empty()) return;
  const auto windows = std::exchange(pending_, {});  // not again where this fails
  pending_values_ = 0;
  lost_ = true;
  for (const auto& [index, window] : windows) append(index, window);
  series_->flush();
  lost_ = false;
  kept_ = {kept_.rows + static_cast<std::int64_t>(windows.size()), windows.back().first + windows.back().second.ticks};
  written_ = std::chrono::steady_clock::now();
}

void Record::append(std::int64_t index, const WindowRecord& window) {
  series_->begin_window(case_.time(index), case_.time(index + window.ticks));
  for (const auto& [name, force] : window.forces) series_->add_field(name, "force", force);
  for (const auto& [name, motion] : window.motion) {
    series_->add_field(name, "displacement", motion.displacement);
    if (!motion.velocity.empty()) series_->add_field(name, "velocity", motion.velocity);
  }
  for (const auto& [name, value] : window.quantities)
    series_->add_scalar("quantities/" + name, value);
  write_ledger(window);
  const auto complete = index + window.ticks;
  if (complete / case_.output_every > index / case_.output_every || complete == case_.windows)
    for (const auto& [name, force] : window.forces) write_picture(complete, name, force);
}

void Record::write_ledger(const WindowRecord& window) {
  double force_loss = 0, moment_loss = 0, worst_distance = 0;
  std::size_t unmapped = 0;
  for (std::size_t k = 0; k < window.ledger.size(); ++k) {
    const auto& row = window.ledger[k];
    const auto name = fmt::format("ledger/{}/", case_.interfaces[k].text());
    for (int d = 0; d < 3; ++d) {
      series_->add_scalar(fmt::format("{}sent.force.{}", name, "xyz"[d]), row.sent.force[d]);
      series_->add_scalar(fmt::format("{}received.force.{}", name, "xyz"[d]),
                          row.received.force[d]);
      series_->add_scalar(fmt::format("{}sent.moment.{}", name, "xyz"[d]), row.sent.moment[d]);
      series_->add_scalar(fmt::format("{}received.moment.{}", name, "xyz"[d]),
                          row.received.moment[d]);
    }
    series_->add_scalar(name + "force_loss", row.loss.force);
    series_->add_scalar(name + "moment_loss", row.loss.moment);
    if (case_.scheme != SchemeKind::one_way) {
      series_->add_scalar(name + "work_sent", row.work_sent);
      series_->add_scalar(name + "work_received", row.work_received);
    }
    force_loss = std::max(force_loss, row.loss.force);
    moment_loss = std::max(moment_loss, row.loss.moment);
    unmapped += row.unmapped;
    worst_distance = std::max(worst_distance, row.worst_distance);
  }
  series_->add_scalar("ledger/force_loss", force_loss);
  series_->add_scalar("ledger/moment_loss", moment_loss);
  series_->add_scalar("ledger/unmapped", static_cast<double>(unmapped));
  series_->add_scalar("ledger/worst_distance", worst_distance);
  series_->add_scalar("ledger/energy_made", window.energy_made);
  if (case_.scheme != SchemeKind::serial_implicit) return;
  series_->add_scalar("ledger/iterations", static_cast<double>(window.iterations));
  series_->add_scalar("ledger/residual", window.residual);
  series_->add_scalar("ledger/jumped", window.jumped ? 1 : 0);
}

void Record::write_picture(std::int64_t complete, const std::string& surface,
                           const std::vector<Vec3>& force) {
  io::PointData data{"force", 3, {}};
  for (const auto& f : force) data.values.insert(data.values.end(), f.data(), f.data() + 3);
  const auto file = fmt::format("{}/surfaces/{}_{:05}.vtp", folder_, surface, complete);
  io::write_surface(file, surfaces_.at(surface), {data});
  pictures_.at(surface).add(case_.time(complete), file);
}

}  // namespace acopla::coupler
