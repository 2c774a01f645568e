#include "coupler/two_way.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "coupler/failure.h"

namespace acopla::coupler {

using geometry::Vec3;

namespace {

double size_of(const std::vector<Vec3>& values) {
  double square = 0;
  for (const auto& value : values) square += value.squaredNorm();
  return std::sqrt(square);
}

std::vector<Vec3>& field_of(protocol::Advance& advance, const std::string& surface, const char* name) {
  for (auto& field : advance.fields)
    if (field.surface == surface && field.name == name) return field.values;
  throw std::logic_error("a crew answer without a field that was asked for");  // Crew refuses those
}

// Nodal forces times nodal motion [J].
double work(const std::vector<Vec3>& forces, const std::vector<Vec3>& from, const std::vector<Vec3>& to) {
  double sum = 0;
  for (std::size_t k = 0; k < forces.size(); ++k) sum += forces[k].dot(to[k] - from[k]);
  return sum;
}

}  // namespace

TwoWay::TwoWay(const Case& read, Crew& crew, Account& account, Reporter& reporter)
    : case_(read), crew_(crew), account_(account), reporter_(reporter), stability_(crew, account), span_(read) {
  for (const auto& participant : case_.participants) (case_.receives(participant.name) ? structures_ : loaders_).push_back(participant.name);
  for (const auto& link : account_.links()) {
    if (!link.mapping) continue;
    const auto& initial = crew_.initial(link.about->to);
    auto& motion = now_[link.about->to.text()];
    const Vectors none(link.to->points.size(), Vec3::Zero());
    motion.displacement = initial.displacement.empty() ? none : initial.displacement;
    motion.velocity = initial.velocity.empty() ? none : initial.velocity;
    account_.set_initial(link.about->to.text(), motion.displacement, motion.velocity);
  }
  if (case_.in_steps.automatic && stability_.silent())
    throw io::UserError(case_.in_steps.at, "coupling.window = \"auto\" needs structures in motion that know what a sudden force moves (fem with analysis = \"dynamic\" "
                                           "does). Give seconds, or \"steps:N\".");
  if (case_.scheme == SchemeKind::serial_implicit) acceleration_ = make_acceleration(case_.implicit.acceleration);
}

void TwoWay::step() {
  window_ = account_.complete();
  WindowRecord window;
  switch (case_.scheme) {
    case SchemeKind::parallel_explicit: step_in_parallel(window); break;
    case SchemeKind::serial_implicit: step_with_iterations(window); break;
    default: step_serially(window);
  }
  account_.close(window);
}

template <class Archive>
void TwoWay::state(Archive& archive) {
  for (auto& [surface, motion] : now_) {
    archive("displacement." + surface, motion.displacement);
    archive("velocity." + surface, motion.velocity);
  }
  archive("warned", warned_);
  archive("span", span_);
  if (case_.scheme == SchemeKind::parallel_explicit)
    for (const auto& link : account_.links()) {
      if (!link.mapping) continue;
      for (const auto& surface : {link.about->from.text(), link.about->to.text()}) archive("last." + link.about->text() + "." + surface, last_.forces[surface]);
    }
  if (case_.scheme == SchemeKind::parallel_explicit) archive("last.arrived", last_.arrived);
  if (!acceleration_) return;
  if constexpr (Archive::reading) acceleration_->read(archive);
  else acceleration_->write(archive);
}
template void TwoWay::state(io::StateWriter&);
template void TwoWay::state(io::StateReader&);

// Both sides compute while the books are kept: the loaders in the next window already, and structures that answer soon while the forces are added up.
// Where windows are long all that waits until the loaders are under way (Crew::give_way).
void TwoWay::step_serially(WindowRecord& window) {
  Forces forces;
  Motions end;
  if (!begun_) begin_next(window_);
  load(window, forces, end);
  begin_structures(std::move(forces));
  const bool beside_structures = crew_.answers_soon();
  if (beside_structures) balance(window);
  Forces none;
  gather(structures_.size(), window, none, end);
  const auto start = std::exchange(now_, std::move(end));
  const auto next = window_ + window.ticks;
  begun_ = next < std::min(case_.windows, case_.next_checkpoint(window_));
  const double length = span_.length();
  span_.go_on(stability_, next);
  if (begun_) {
    begin_next(next);
    crew_.give_way();
  }
  if (!beside_structures) balance(window);
  book(window, window, start, moved_on(start, length), now_);
}

// A scene pays for keeping its state where its windows find their length by themselves, and only while a first contact may be too stiff for it.
void TwoWay::begin_next(std::int64_t window) {
  if (span_.exposed() && std::all_of(loaders_.begin(), loaders_.end(), [&](const auto& name) { return crew_.saves(name); })) {
    crew_.save(loaders_);
    saved_ = true;
  }
  begin_loaders(window, nullptr);
}

// The loaders' forces, of a window that is taken back while it was too long for the contacts it met: the structures know nothing of it yet.
void TwoWay::load(WindowRecord& window, Forces& forces, Motions& end) {
  while (true) {
    gather(loaders_.size(), window, forces, end);
    window.ticks = span_.ticks();
    const auto pushes = [](const auto& surface) { return size_of(surface.second) > 0; };
    if (!saved_) break;
    const bool met = std::any_of(forces.begin(), forces.end(), pushes);
    if (!span_.too_long(stability_, met)) break;
    crew_.restore(loaders_);
    span_.shorten(stability_, met);
    window = {};
    forces.clear();
    begin_loaders(window_, nullptr);
  }
  saved_ = false;
  if (estimates(window_)) check_stability();
}

void TwoWay::step_in_parallel(WindowRecord& window) {
  Forces forces;
  Motions end;
  begin_structures(last_.forces);
  begin_loaders(window_, nullptr);
  gather(loaders_.size() + structures_.size(), window, forces, end);
  if (estimates(window_)) check_stability();
  balance(window);
  book(window, last_, now_, moved_on(now_, span_.length()), end);
  now_ = std::move(end);
  last_.forces = window.forces;
  last_.arrived = window.arrived;
}

void TwoWay::step_with_iterations(WindowRecord& window) {
  const auto& settings = case_.implicit;
  std::vector<std::string> everybody = loaders_;
  everybody.insert(everybody.end(), structures_.begin(), structures_.end());
  crew_.save(everybody);
  acceleration_->begin_window();
  jump_.begin_window();
  auto assumed = flat(moved_on(now_, span_.length()));
  const auto start = flat(now_);
  std::vector<double> residuals;
  double force_change = 0;
  Forces before;
  bool settled = false;  // on one side of a jump
  for (int iteration = 1;; ++iteration) {
    if (iteration > 1) crew_.restore(everybody);
    window = {};
    Forces forces;
    Motions end;
    const auto moved_to = unflat(assumed);
    begin_loaders(window_, &moved_to);
    gather(loaders_.size(), window, forces, end);
    begin_structures(forces);
    gather(structures_.size(), window, forces, end);
    window.iterations = iteration;
    const auto answered = flat(end);

    // Motion counts from the window's start, so that a tolerance means the same however far the structure has gone.
    const Eigen::VectorXd residual = answered - assumed;
    const double moved = (answered - start).norm(), tolerance = std::max(settings.relative * moved, settings.displacement);
    residuals.push_back(residual.norm());
    const bool forces_agree = iteration == 1 || agree(forces, before, force_change);
    window.residual = moved > 0 ? residuals.back() / moved : residuals.back();
    window.converged = residuals.back() <= tolerance && forces_agree;
    window.jumped = settled && !window.converged;
    const bool last = iteration >= settings.most_iterations;
    if (last && settings.stops && !window.converged && !settled) give_up(residuals, force_change);
    if (window.converged || settled || last) {
      if (settled) window.converged = true;
      acceleration_->end_window();
      balance(window);
      book(window, window, now_, moved_to, end);
      now_ = std::move(end);
      return;
    }
    const bool enclosed = jump_.enclosed();
    jump_.note(assumed, residual, tolerance);
    settled = jump_.closer_than(tolerance);
    // The acceleration is not shown both sides of a jump: it would take it for a slope.
    assumed = settled ? jump_.better() : jump_.enclosed() ? jump_.next() : acceleration_->next(assumed, answered);
    if (jump_.enclosed() && !enclosed) acceleration_->forget();
    before = std::move(forces);
  }
}

// The first iterations of a window have nothing to be compared with. @param change  of the forces, over their size
bool TwoWay::agree(const Forces& forces, const Forces& before, double& change) const {
  double difference = 0, size = 0;
  for (const auto& [surface, values] : forces) {
    Vectors apart = values;
    for (std::size_t k = 0; k < values.size(); ++k) apart[k] -= before.at(surface)[k];
    difference = std::hypot(difference, size_of(apart));
    size = std::hypot(size, size_of(values));
  }
  change = size > 0 ? difference / size : 0;
  return difference <= std::max(case_.implicit.relative * size, case_.implicit.force);
}

void TwoWay::give_up(const std::vector<double>& residuals, double force_change) const {
  const auto last = residuals.size() - 1;
  const double ratio = last > 0 ? residuals[last] / residuals[last - 1] : 1, overall = residuals[last] / residuals[0];
  int rises = 0;
  for (std::size_t k = 1; k < residuals.size(); ++k) rises += residuals[k] > residuals[k - 1];
  const char* how = overall > 1                                        ? "grows: the coupling is stronger than the relaxation; lower relaxation, or shorten the window"
                    : 3 * rises > static_cast<int>(residuals.size())   ? "goes up and down: contacts may open and close between iterations; shorten the window, or lower relaxation"
                    : ratio > 0.8                                      ? (case_.implicit.acceleration.kind == AccelerationKind::iqn_ils
                                                                             ? "creeps: a contact may begin or slide between two iterations; give tolerance = { displacement = …, force = … } as well"
                                                                             : "creeps: try acceleration = \"iqn-ils\", or a larger relaxation")
                                                                       : "falls steadily: raise max_iterations";
  throw Failure("coupler", "iterating",
                fmt::format("the window from {:.6g} s to {:.6g} s did not converge in {} iterations: the motion's residual went from {:.3g} to {:.3g} m and {}. "
                            "(The forces last changed by {:.2g} of themselves.) on_fail = \"accept\" goes on all the same.",
                            case_.time(window_), case_.time(window_ + 1), residuals.size(), residuals.front(), residuals.back(), how, force_change),
                Failure::Cause::limit);
}

// Where the loaders' surfaces go by themselves: on with their velocity.
TwoWay::Motions TwoWay::moved_on(const Motions& start, double length) const {
  auto motions = start;
  for (auto& [surface, motion] : motions)
    for (std::size_t k = 0; k < motion.displacement.size(); ++k) motion.displacement[k] += length * motion.velocity[k];
  return motions;
}

/// Adds to the motion of a loader's surface what an interface carries there: nothing at points that belong to another.
void TwoWay::carry(const Link& link, const Motions& motions, Motion& moved) const {
  const auto& motion = motions.at(link.about->to.text());
  const auto add = [&](const Vectors& values, Vectors& sum) {
    Vectors part(link.from->points.size());
    if (link.about->consistent_motion) link.mapping->values(values, part);
    else link.mapping->conjugate_values(values, part);
    if (sum.empty()) sum = std::move(part);
    else
      for (std::size_t k = 0; k < part.size(); ++k) sum[k] += part[k];
  };
  add(motion.displacement, moved.displacement);
  add(motion.velocity, moved.velocity);
}

void TwoWay::begin_loaders(std::int64_t window, const Motions* end) {
  for (const auto& name : loaders_) {
    std::map<std::string, Motion> starts, ends;
    for (const auto& link : account_.links()) {
      if (!link.mapping || link.about->from.participant != name) continue;
      carry(link, now_, starts[link.about->from.surface]);
      if (end) carry(link, *end, ends[link.about->from.surface]);
    }
    std::vector<protocol::Field> fields;
    for (auto& [surface, motion] : starts) {
      fields.push_back({surface, "displacement", std::move(motion.displacement)});
      fields.push_back({surface, "velocity", std::move(motion.velocity)});
    }
    for (auto& [surface, motion] : ends) {
      fields.push_back({surface, "end_displacement", std::move(motion.displacement)});
      fields.push_back({surface, "end_velocity", std::move(motion.velocity)});
    }
    crew_.begin_advance(name, window, window + span_.ticks(), std::move(fields), estimates(window));
  }
}

void TwoWay::begin_structures(Forces forces) {
  for (const auto& name : structures_) {
    std::vector<protocol::Field> fields;
    for (const auto& [surface, motion] : now_) {
      const auto dot = surface.find('.');
      if (surface.substr(0, dot) != name) continue;
      const auto found = forces.find(surface);
      fields.push_back({surface.substr(dot + 1), "force", found != forces.end() ? std::move(found->second) : Vectors(motion.displacement.size(), Vec3::Zero())});
    }
    crew_.begin_advance(name, window_, window_ + span_.ticks(), std::move(fields));
  }
}

// So many answers, in any order; sums do not depend on it, since the account maps loader by loader.
void TwoWay::gather(std::size_t answers, WindowRecord& window, Forces& forces, Motions& motions) {
  std::map<std::string, protocol::Advance> came;
  for (std::size_t k = 0; k < answers; ++k) {
    auto answer = crew_.next_answer();
    came[answer.participant] = std::move(answer.advance);
  }
  for (auto& [name, advance] : came) {
    for (const auto& [quantity, value] : advance.quantities) window.quantities.emplace_back(name + "." + quantity, value);
    if (!case_.receives(name)) {
      account_.map_forces(name, advance, window, forces);
      continue;
    }
    for (const auto& [surface, motion] : now_) {
      const auto dot = surface.find('.');
      if (surface.substr(0, dot) != name) continue;
      const auto own = surface.substr(dot + 1);
      motions[surface] = {std::move(field_of(advance, own, "displacement")), std::move(field_of(advance, own, "velocity"))};
    }
  }
  for (const auto& [surface, values] : forces) window.forces[surface] = values;
  if (estimates(window_)) stability_.measure(came);
}

void TwoWay::balance(WindowRecord& window) const {
  for (const auto& name : loaders_) account_.balance(name, window, window.forces);
}

// Contacts come and go slowly beside windows, but windows that find their length by themselves must see the first.
bool TwoWay::estimates(std::int64_t window) const {
  if (stability_.silent() || case_.scheme == SchemeKind::serial_implicit) return false;
  return case_.in_steps.automatic || window < 10 || window % 20 == 0;
}

void TwoWay::check_stability() {
  const auto worst = stability_.worst(span_.length());
  // Each free particle of this kind would treble its motion in a hundred windows; a bed holds its particles, so this is said, not refused.
  if (worst.growth > 0.01 && !grows_) {
    reporter_.note(fmt::format("at {:.6g} s the lightest contacts would grow by {:.2g} of their motion in each window, were their particles free and "
                               "undamped otherwise: the coupling may make energy. Shorten the window, or take scheme = \"implicit\".", case_.time(window_), worst.growth));
    grows_ = true;
  }
  if (worst.ratio <= 0.5) return;
  const auto found = std::find_if(account_.links().begin(), account_.links().end(), [&](const Link& link) { return link.mapping && link.about->to.text() == worst.surface; });
  const Vec3& at = found->to->points[worst.node];
  const auto text = fmt::format("at {:.6g} s the contacts on {} at ({:.4g}, {:.4g}, {:.4g}) m and the {:.3g} kg there turn by {:.2f} radians a window",
                                case_.time(window_), worst.surface, at[0], at[1], at[2], stability_.mass_at(worst), worst.ratio);
  if (worst.ratio > 1 && !case_.allows_unstable)
    throw Failure("coupler", "coupling",
                  fmt::format("{}: an explicit scheme is unstable from 2 on, and refused from 1 on. {}, take softer contacts, a "
                              "heavier surface or scheme = \"implicit\"; or say allow_unstable_scheme = true.", text,
                              case_.in_steps.automatic ? "A window is a step of the particles already: shorten that" : "Shorten the window"),
                  Failure::Cause::limit);
  if (!warned_) reporter_.note(fmt::format("{}; from 0.5 on the explicit scheme loses accuracy, beyond 1 it is refused.", text));
  warned_ = true;
}

// A consistent motion is not the transpose of the forces: the work is that on the points which sent them.
double TwoWay::work_at_sender(const Link& link, const WindowRecord& window, const Motions& start, const Motions& moved_to) const {
  Motion from, to;
  carry(link, start, from);
  carry(link, moved_to, to);
  return work(window.forces.at(link.about->from.text()), from.displacement, to.displacement);
}

// What the coupling makes: the work of the forces on the structure, less that on the surface that sent them, which went another way or,
// in parallel, felt others. With `conjugate_values` the two are the same for the same motion, on surfaces that do not coincide too.
void TwoWay::book(WindowRecord& window, const WindowRecord& acting, const Motions& start, const Motions& moved_to, const Motions& end) const {
  for (std::size_t k = 0; k < account_.links().size(); ++k) {
    const auto& link = account_.links()[k];
    if (!link.mapping) continue;
    const auto to = link.about->to.text();
    const auto& from = start.at(to).displacement;
    auto& row = window.ledger[k];
    row.work_sent = link.about->consistent_motion ? work_at_sender(link, window, start, moved_to)
                                                  : work(account_.arrived(k, window, window.forces), from, moved_to.at(to).displacement);
    if (acting.forces.empty()) continue;  // nothing acted yet
    row.work_received = work(account_.arrived(k, acting, acting.forces), from, end.at(to).displacement);
  }
  if (case_.record_motion)
    for (const auto& [surface, motion] : end) window.motion[surface] = {motion.displacement, motion.velocity};
}

Eigen::VectorXd TwoWay::flat(const Motions& motions) const {
  std::size_t size = 0;
  for (const auto& [surface, motion] : motions) size += 6 * motion.displacement.size();
  Eigen::VectorXd values(static_cast<Eigen::Index>(size));
  Eigen::Index at = 0;
  for (const auto& [surface, motion] : motions)
    for (std::size_t k = 0; k < motion.displacement.size(); ++k, at += 6) {
      values.segment<3>(at) = motion.displacement[k];
      values.segment<3>(at + 3) = case_.window * motion.velocity[k];
    }
  return values;
}

TwoWay::Motions TwoWay::unflat(const Eigen::VectorXd& values) const {
  auto motions = now_;
  Eigen::Index at = 0;
  for (auto& [surface, motion] : motions)
    for (std::size_t k = 0; k < motion.displacement.size(); ++k, at += 6) {
      motion.displacement[k] = values.segment<3>(at);
      motion.velocity[k] = values.segment<3>(at + 3) / case_.window;
    }
  return motions;
}

}  // namespace acopla::coupler
