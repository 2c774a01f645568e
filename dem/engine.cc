#include "dem/engine.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <stdexcept>

#include "dem/domain.h"
#include "dem/laws.h"
#include "dem/simd.h"

namespace acopla::dem {
namespace {

// One kernel for every pair of materials that can meet, and nothing for the others.
KernelTable make_kernels(const Scene& scene) {
  KernelTable table;
  table.laws = scene.laws;
  table.materials = scene.materials.size();
  table.group.assign(table.materials * table.materials, 0);
  table.kernel.push_back(nullptr);
  for (std::size_t a = 0; a < table.materials; ++a)
    for (std::size_t b = a; b < table.materials; ++b) {
      const auto& pair = scene.pair(a, b);
      if (pair.laws.normal.empty()) continue;
      table.group[a * table.materials + b] = table.group[b * table.materials + a] = static_cast<std::uint16_t>(table.kernel.size());
      table.kernel.push_back(scene.laws->make(pair, scene.dimension));
    }
  if (table.kernel.size() == 2 && table.materials == 1) {
    table.kernel.erase(table.kernel.begin());
    table.group[0] = 0;
  }
  return table;
}

}  // namespace

Engine::Engine(const Scene& scene, Particles particles, WallSet walls)
    : gravity_(scene.gravity), damping_(scene.damping), kernels_(make_kernels(scene)), particles_(std::move(particles)), walls_(std::move(walls)),
      keeps_ledger_(scene.keeps_ledger), allow_unstable_(scene.allow_unstable_step), drift_limit_(scene.drift_limit),
      partitions_(std::max(1u, scene.partitions)), team_(std::max(1u, scene.threads)) {
  for (const auto& material : scene.materials) densities_.push_back(material.density);
  set_sizes();
  domain_ = domain_of(scene, particles_, walls_);
  loads_ = WallLoadSum(walls_, partitions_.size());
}

void Engine::set_sizes() {
  const auto before = smallest_;
  smallest_ = largest_ = particles_.size() ? particles_.position[0].w : 0;
  for (const auto& p : particles_.position) {
    smallest_ = std::min(smallest_, p.w);
    largest_ = std::max(largest_, p.w);
  }
  one_material_ = std::adjacent_find(particles_.material.begin(), particles_.material.end(), std::not_equal_to<>()) == particles_.material.end();
  if (before != smallest_) {
    skin_ = 0.3 * smallest_;
    near_skin_ = 0.01 * smallest_;
  }
}

void Engine::advance(std::uint64_t steps, double step) {
  if (!started_) start();
  else if (outdated_) rebuild();
  if (steps == 0) return;  // only the lists and the first forces
  loads_.begin();
  for (std::uint64_t k = 0; k < steps; ++k) {
    move(k == 0 ? 0.5 * step : step, step);
    time_ += step;
    if (walls_.move_at_all()) walls_.move(time_, step);
    keep_lists(step);
    if (k + 1 == steps) loads_.begin_last();
    evaluate(step);
  }
  complete(0.5 * step);
  load_ = loads_.finish(walls_, static_cast<double>(steps));
  if (keeps_ledger_) check_energy(step);
}

// Forces where the particles are put; no time passes, so no spring of friction moves.
void Engine::start() {
  rebuild();
  loads_.begin_last();
  evaluate(0);
  check_first_overlaps();
  for (auto& partition : partitions_) complete_forces(partition);
  started_ = true;
  if (keeps_ledger_) energy();
}

void Engine::restart_clock() {
  time_ = 0;
  ledger_ = {};
  if (keeps_ledger_ && started_) energy();
}

void Engine::move(double kick, double step) {
  team_.run(static_cast<unsigned>(partitions_.size()), [&](unsigned p) {
    auto& partition = partitions_[p];
    if (!partition.complete) complete_forces(partition);
    partition.travel = dem::move(particles_, gravity_, kick, step, partition.first, partition.last);
    partition.complete = false;
  });
}

// Velocities at the window's end. The forces stay: the next window begins with them.
void Engine::complete(double kick) {
  team_.run(static_cast<unsigned>(partitions_.size()), [&](unsigned p) {
    auto& partition = partitions_[p];
    complete_forces(partition);
    dem::kick(particles_, gravity_, kick, partition.first, partition.last);
  });
}

// What the contacts of other partitions and the damping add to the forces of the contacts here.
void Engine::complete_forces(Partition& partition) {
  take_imports(partition);
  if (!damping_.none()) partition.damping_power = damp(damping_, particles_, gravity_, partition.first, partition.last);
  partition.complete = true;
}

void Engine::take_imports(Partition& partition) {
  const bool spins = particles_.has_spins();
  for (const auto& import : partition.imports) {
    const auto& exports = partitions_[import.from].pairs.exports;
    as_vector(particles_.force[import.particle]) += as_vector(exports.force[import.place]);
    if (spins) as_vector(particles_.torque[import.particle]) += as_vector(exports.torque[import.place]);
  }
}

// Looks whether the lists still hold everybody, after the particles have moved.
void Engine::keep_lists(double step) {
  Travel travel;
  for (const auto& partition : partitions_) travel.include(partition.travel);
  if (!travel.finite || travel.bound > 0.5 * smallest_) stop_at_fastest(step);
  travel_ += travel.bound;
  near_travel_ += travel.bound;
  ++steps_since_rebuild_;
  ++steps_since_refresh_;
  // The bound adds up what no particle exceeded in each step; only when it is used up is it worth to measure how far they are.
  const double on_walls = walls_.travel_since_mark();
  if (2 * (travel_ + on_walls) >= skin_) {
    travel_ = farthest();
    if (2.5 * (travel_ + on_walls) >= skin_) {
      rebuild();
      return;
    }
  }
  if (2 * near_travel_ >= near_skin_) refresh(nullptr);
}

double Engine::farthest() const {
  double square = 0;
  for (std::size_t i = 0; i < particles_.size(); ++i) {
    const auto &x = particles_.position[i], &r = reference_[i];
    const double dx = x.x - r.x, dy = x.y - r.y, dz = x.z - r.z;
    square = std::max(square, dx * dx + dy * dy + dz * dz);
  }
  return std::sqrt(square);
}

void Engine::evaluate(double step) {
  team_.run(static_cast<unsigned>(partitions_.size()), [&](unsigned p) {
    auto& partition = partitions_[p];
    partition.energy = {};
    auto* energy = keeps_ledger_ ? &partition.energy : nullptr;
    partition.pairs.evaluate(kernels_, particles_, step, energy);
    if (walls_.empty()) return;
    partition.walls.update(walls_, particles_, time_);
    partition.walls.evaluate(kernels_, walls_, particles_, step, loads_.of(p), energy);
  });
  if (walls_.has_servos()) {
    walls_.begin_forces();
    for (const auto& partition : partitions_) walls_.add_forces(partition.walls.resultants());
  }
  if (!keeps_ledger_) return;
  ContactEnergy<double> sum;
  double damping = 0, walls = 0;
  for (const auto& partition : partitions_) {
    sum.add(partition.energy);
    damping += partition.damping_power;
    for (const auto& resultant : partition.walls.resultants()) walls += resultant.power;
  }
  ledger_.step(sum, damping, walls, step);
}

// Lists who is near whom, in an order that keeps neighbours in memory together, and carries the histories over.
void Engine::rebuild(const std::vector<std::uint32_t>* stay) {
  // The skin follows the motion: a list that lasts long may be tighter, one that does not must be looser.
  if (rebuilds_ > 0 && !outdated_) {
    if (steps_since_rebuild_ < 20) skin_ = std::min(1.2 * skin_, 0.8 * smallest_);
    else if (steps_since_rebuild_ > 400) skin_ = std::max(0.85 * skin_, 0.08 * smallest_);
  }
  const auto parts = static_cast<std::uint32_t>(partitions_.size());
  saved_pairs_.clear(parts);
  saved_walls_.clear();
  team_.run(parts, [&](unsigned p) { partitions_[p].pairs.save(saved_pairs_, p, kernels_); });
  for (auto& partition : partitions_) partition.walls.collect(particles_, saved_walls_);
  saved_walls_.sort();
  place_.resize(particles_.size());
  std::iota(place_.begin(), place_.end(), 0u);
  if (stay) sort_particles(*stay);
  check_domain();
  if (rebuilds_ % 16 == 0 || outdated_) {
    curve_order(particles_.position, order_);
    sort_particles(order_);
  }
  team_.run(2, [&](unsigned task) {
    if (task == 0) grid_.build(particles_.position, skin_);
    else saved_pairs_.settle(place_, kernels_, particles_.size());
  });
  const auto count = static_cast<std::uint32_t>(particles_.size());
  walls_.mark(domain_.low, domain_.high, largest_);
  team_.run(parts, [&](unsigned p) {
    auto& partition = partitions_[p];
    partition.first = static_cast<std::uint32_t>(std::uint64_t{count} * p / parts);
    partition.last = static_cast<std::uint32_t>(std::uint64_t{count} * (p + 1) / parts);
    grid_.find_pairs(partition.first, partition.last, partition.rows);
    if (walls_.empty()) return;
    partition.walls.find(kernels_, walls_, particles_, partition.first, partition.last, skin_);
    partition.walls.restore(walls_, particles_, saved_walls_);
  });
  reference_ = particles_.position;
  travel_ = 0;
  steps_since_rebuild_ = 0;
  outdated_ = false;
  ++rebuilds_;
  refresh(&saved_pairs_);
}

void Engine::refresh(const SavedPairs* saved) {
  if (!saved && refreshes_ > 0) {
    // Searching costs about as much as computing a fifth of the pairs; each hundredth of a radius adds some pairs in a hundred.
    if (steps_since_refresh_ < 4) near_skin_ = std::min(1.3 * near_skin_, 0.25 * skin_);
    else if (steps_since_refresh_ > 12) near_skin_ = std::max(0.8 * near_skin_, 1e-4 * smallest_);
  }
  team_.run(static_cast<unsigned>(partitions_.size()), [&](unsigned p) {
    auto& partition = partitions_[p];
    partition.pairs.refresh(particles_, partition.rows, partition.first, partition.last, near_skin_, kernels_, one_material_, saved);
  });
  near_travel_ = 0;
  steps_since_refresh_ = 0;
  ++refreshes_;
  link_exports();
}

void Engine::link_exports() {
  if (partitions_.size() == 1) return;
  for (auto& partition : partitions_) partition.imports.clear();
  const auto count = particles_.size();
  const auto parts = partitions_.size();
  for (std::uint32_t p = 0; p < parts; ++p)
    partitions_[p].pairs.for_each_export([&](std::uint32_t particle, std::size_t place) {
      std::size_t owner = std::uint64_t{particle} * parts / std::max<std::size_t>(1, count);
      while (owner + 1 < parts && particle >= partitions_[owner].last) ++owner;
      while (owner > 0 && particle < partitions_[owner].first) --owner;
      partitions_[owner].imports.push_back({p, static_cast<std::uint32_t>(place), particle});
    });
}

// Entry k becomes the former entry order[k]; place_ follows the particles of the last list.
void Engine::sort_particles(const std::vector<std::uint32_t>& order) {
  std::vector<std::uint32_t> moved(particles_.size(), SavedPairs::gone);
  for (std::uint32_t k = 0; k < order.size(); ++k) moved[order[k]] = k;
  for (auto& place : place_)
    if (place != SavedPairs::gone) place = moved[place];
  particles_.reorder(order);
}

void Engine::insert(const std::vector<NewParticle>& particles) {
  if (particles.empty()) return;
  const double before = keeps_ledger_ ? kinetic_energy() + potential_energy() : 0;
  for (const auto& p : particles) particles_.add(p.at, p.radius, densities_[p.material], p.material, p.velocity, p.spin);
  if (keeps_ledger_) ledger_.add(kinetic_energy() + potential_energy() - before);
  set_sizes();
  outdated_ = true;
}

double Engine::remove(const std::function<bool(std::size_t)>& leaves) {
  std::vector<std::uint32_t> stay;
  double mass = 0;
  for (std::uint32_t i = 0; i < particles_.size(); ++i) {
    if (leaves(i)) mass += particles_.mass_of(i);
    else stay.push_back(i);
  }
  if (stay.size() == particles_.size()) return 0;
  const double before = keeps_ledger_ ? kinetic_energy() + potential_energy() : 0;
  outdated_ = true;
  rebuild(&stay);
  if (keeps_ledger_) ledger_.add(kinetic_energy() + potential_energy() - before);
  set_sizes();
  return mass;
}

std::size_t Engine::contact_count() const {
  std::size_t count = 0;
  for_each_pair([&](std::uint32_t, std::uint32_t, double) { ++count; });
  for (const auto& partition : partitions_) count += partition.walls.contact_count();
  return count;
}

std::size_t Engine::listed_pairs() const {
  std::size_t count = 0;
  for (const auto& partition : partitions_) count += partition.rows.size();
  return count;
}

std::size_t Engine::near_pairs() const {
  std::size_t count = 0;
  for (const auto& partition : partitions_) count += partition.pairs.size();
  return count;
}

double Engine::worst_overlap() const {
  double worst = 0;
  for_each_pair([&](std::uint32_t i, std::uint32_t j, double overlap) {
    worst = std::max(worst, overlap / std::min(particles_.radius_of(i), particles_.radius_of(j)));
  });
  return worst;
}

EngineCosts Engine::costs() const {
  std::size_t history = 0;
  for (const auto& kernel : kernels_.kernel)
    if (kernel) history = std::max(history, kernel->history_size());
  return {particles_.bytes_each() + sizeof(Record), 3 * sizeof(std::uint32_t) + history * sizeof(double)};
}

double Engine::kinetic_energy() const {
  double energy = 0;
  for (std::size_t i = 0; i < particles_.size(); ++i) {
    energy += 0.5 * particles_.mass_of(i) * particles_.velocity_of(i).squaredNorm();
    if (particles_.kind.rotates) energy += 0.5 * particles_.inertia_of(i) * particles_.spin_of(i).squaredNorm();
  }
  return energy;
}

double Engine::potential_energy() const {
  double energy = 0;
  for (std::size_t i = 0; i < particles_.size(); ++i) energy -= particles_.mass_of(i) * gravity_.dot(particles_.position[i].vector());
  return energy;
}

double Engine::mass() const {
  double mass = 0;
  for (const auto& v : particles_.velocity) mass += v.w;
  return mass;
}

Vec3 Engine::momentum() const {
  Vec3 momentum = Vec3::Zero();
  for (std::size_t i = 0; i < particles_.size(); ++i) momentum += particles_.mass_of(i) * particles_.velocity_of(i);
  return momentum;
}

Energy Engine::energy() { return ledger_.balance(kinetic_energy(), potential_energy()); }

Engine::Hold Engine::hold_on(std::size_t wall) const {
  WallForces stiffness;
  stiffness.vertex.assign(walls_.sent_vertices(), Vec3::Zero());
  stiffness.couple.assign(walls_.sent_facets(), Vec3::Zero());
  auto dashpot = stiffness, mass = stiffness;
  for (const auto& partition : partitions_) partition.walls.add_stiffness(kernels_, walls_, particles_, stiffness, dashpot, mass);
  const auto of_wall = [&](const WallForces& all) {
    const auto begin = all.vertex.begin() + static_cast<std::ptrdiff_t>(walls_.sent_vertex(wall, walls_.first_vertex(wall)));
    return std::vector<Vec3>(begin, begin + (walls_.first_vertex(wall + 1) - walls_.first_vertex(wall)));
  };
  return {of_wall(stiffness), of_wall(dashpot), of_wall(mass)};
}

StabilityEstimate Engine::stability(double step) const {
  StabilityEstimate estimate(particles_, step);
  for_each_pair([&](std::uint32_t i, std::uint32_t j, double overlap) {
    estimate.add_pair(i, j, overlap, kernels_.of(particles_.material[i], particles_.material[j]));
  });
  for (const auto& partition : partitions_)
    partition.walls.for_each_contact([&](std::uint32_t i, std::uint8_t material, std::uint8_t wall, double overlap, const Vec3& normal,
                                         double curvature) { estimate.add_wall(i, overlap, normal, curvature, kernels_.of(material, wall)); });
  return estimate;
}

void Engine::check_domain() const {
  for (std::size_t i = 0; i < particles_.size(); ++i)
    if (const Vec3 x = particles_.position[i].vector();
        !((x - domain_.low).minCoeff() >= 0 && (domain_.high - x).minCoeff() >= 0))
      throw std::runtime_error(fmt::format(
          "particle {} left the domain at t = {:.6g} s: it is at ({:.4g}, {:.4g}, {:.4g}) m. Close the walls, shorten the step, or "
          "widen `domain`.", particles_.id[i], time_, x[0], x[1], x[2]));
}

// Deeper than half a radius is no contact: its energy would throw the two apart.
void Engine::check_first_overlaps() const {
  if (allow_unstable_) return;
  for_each_pair([&](std::uint32_t i, std::uint32_t j, double overlap) {
    const double depth = overlap / std::min(particles_.radius_of(i), particles_.radius_of(j));
    if (depth <= 0.5) return;
    const Vec3 x = particles_.position[i].vector();
    throw std::runtime_error(fmt::format(
        "particles {} and {} begin with an overlap of {:.2g} of the smaller one's radius, at ({:.4g}, {:.4g}, {:.4g}) m. Put them apart, or "
        "say allow_unstable_step = true.",
        particles_.id[i], particles_.id[j], depth, x[0], x[1], x[2]));
  });
}

void Engine::stop_at_fastest(double step) const {
  std::size_t worst = 0;
  double fastest = -1;
  for (std::size_t i = 0; i < particles_.size(); ++i) {
    const double speed = particles_.velocity_of(i).norm();
    if (!(speed <= fastest)) {
      fastest = speed;
      worst = i;
      if (!(speed <= 1e300)) break;
    }
  }
  if (fastest * step <= 0.5 * smallest_) return;  // the bound is up to sqrt(3) times the truth
  const Vec3 x = particles_.position[worst].vector();
  throw std::runtime_error(fmt::format(
      "particle {} moves {:.3g} m in one step of {:.3g} s at t = {:.6g} s, more than half the smallest radius; it is at ({:.4g}, {:.4g}, "
      "{:.4g}) m. The step is too long for this speed, or the run has become unstable: lower step_fraction.",
      particles_.id[worst], fastest * step, step, time_, x[0], x[1], x[2]));
}

void Engine::check_energy(double step) {
  const auto balance = energy();
  if (allow_unstable_ || balance.relative_drift <= drift_limit_) return;
  const auto ratio = step_ratio(step);
  const Vec3 x = particles_.size() ? particles_.position[ratio.particle].vector() : Vec3::Zero();
  throw std::runtime_error(fmt::format(
      "the energy drifts: at t = {:.6g} s the steps have {} {:.3g} J that no mechanism accounts for, {:.2g} of what the scene held "
      "(limit {:.2g}). {} The stiffest contacts are those of particle {} at ({:.4g}, {:.4g}, {:.4g}) m, where the step is {:.2f} of the "
      "stability limit.",
      time_, balance.drift > 0 || balance.made > -balance.drift ? "made" : "lost", std::max(std::abs(balance.drift), balance.made),
      balance.relative_drift, drift_limit_,
      ratio.value > 0.5 ? "The step is too long: lower step_fraction." : "The contacts are resolved too coarsely: lower step_fraction, or soften them.",
      particles_.size() ? particles_.id[ratio.particle] : 0, x[0], x[1], x[2], ratio.value));
}

std::unique_ptr<Engine> make_engine(const Scene& scene, Particles particles) {
  return make_engine(scene, std::move(particles), WallSet(scene.walls));
}

std::unique_ptr<Engine> make_engine(const Scene& scene, Particles particles, WallSet walls) {
  return std::make_unique<Engine>(scene, std::move(particles), std::move(walls));
}

}  // namespace acopla::dem
