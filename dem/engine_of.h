// The engine of one contact model. Included by dem/kernels/ only.
//
// One step is velocity Verlet with predicted velocities, which is leapfrog for forces of position and stays of second
// order with dashpots (Groot & Warren 1997, λ = 1):
//   x += v Δt + a Δt²/2,  ṽ = v + a Δt,  a' = F(x, ṽ)/m + g,  v = ṽ + (a' − a) Δt/2.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "dem/contact/model.h"
#include "dem/engine.h"
#include "dem/neighbours.h"
#include "dem/wall/touching.h"
#include "geometry/couple.h"

namespace acopla::dem {

template <class Model>
class EngineOf final : public Engine {
 public:
  EngineOf(const Scene& scene, Particles particles, WallSet walls)
      : gravity_(scene.gravity), materials_(scene.materials.size()), particles_(std::move(particles)), walls_(std::move(walls)) {
    for (const auto& pair : scene.pairs) parameters_.push_back(Model::from(pair));
    pair_properties_ = scene.pairs;
    batches_.resize(scene.pairs.size());
    for (const auto& wall : walls_.walls()) wall_material_.push_back(wall.material);
    smallest_ = largest_ = particles_.size() ? particles_.position[0].w : 0;
    for (const auto& p : particles_.position) {
      smallest_ = std::min(smallest_, p.w);
      largest_ = std::max(largest_, p.w);
    }
    skin_ = 0.3 * smallest_;
    set_domain(scene);
    accumulator_.vertex_force.assign(walls_.vertices().size(), Vec3::Zero());
    accumulator_.wall_force.assign(walls_.walls().size(), Vec3::Zero());
    if constexpr (Model::has_rolling) accumulator_.couple.assign(walls_.first_triangle(walls_.walls().size()), Vec3::Zero());
    edge_ = accumulator_;
    load_.vertex_force = accumulator_.vertex_force;
    load_.wall_force = accumulator_.wall_force;
  }

  void advance(std::uint64_t steps, double step) override {
    if (!started_) start(step);
    // The forces at the window's ends belong half to each of its neighbours.
    accumulator_.scale_from(edge_, 0.5);
    for (std::uint64_t k = 0; k < steps; ++k) {
      begin_step(step);
      const bool last = k + 1 == steps;
      if (last) edge_.clear();
      evaluate(step, last ? edge_ : accumulator_);
      end_step(step);
      time_ += step;
    }
    accumulator_.add(edge_, 0.5);
    finish_load(static_cast<double>(steps));
  }

  const WallLoad& wall_load() const override { return load_; }
  const Particles& particles() const override { return particles_; }
  Particles& particles() override { return particles_; }
  std::size_t contact_count() const override { return touching_ + wall_contacts_; }
  std::uint64_t rebuilds() const override { return rebuilds_; }
  std::size_t listed_pairs() const override { return pairs_.size(); }

  EngineCosts costs() const override {
    return {particles_.bytes_each() + sizeof(Record), sizeof(std::uint32_t) + sizeof(std::uint8_t) + history_bytes};
  }

  double worst_overlap() const override {
    double worst = 0;
    for_each_contact([&](std::uint32_t i, std::uint32_t j, double overlap) {
      worst = std::max(worst, overlap / std::min(particles_.position[i].w, particles_.position[j].w));
    });
    return worst;
  }

  double step_ratio(double step) const override {
    // Per particle the sums of stiffness and dashpot over its contacts, whatever their directions: the sum over all
    // directions is about three times that along one, which covers that neighbours move against each other.
    std::vector<double> stiffness(particles_.size(), 0.0), dashpot(particles_.size(), 0.0);
    const auto add = [&](std::uint32_t i, const Kinematics<double>& k, const PairProperties& pair) {
      const double k_n = Model::Normal::stiffness(k, Model::Normal::from(pair));
      stiffness[i] += k_n;
      dashpot[i] += (pair.hertz_damping > 0 ? pair.hertz_damping : 2 * pair.damping_ratio) * std::sqrt(k_n * k.reduced_mass);
    };
    for_each_contact([&](std::uint32_t i, std::uint32_t j, double overlap) {
      const auto k = still(i, j, overlap);
      const auto& pair = pair_properties_[particles_.material[i] * materials_ + particles_.material[j]];
      add(i, k, pair);
      add(j, k, pair);
    });
    for_each_wall_overlap([&](std::uint32_t i, std::uint32_t element, double overlap) {
      add(i, still(i, overlap), pair_properties_[particles_.material[i] * materials_ + wall_material_[walls_.wall_of(element)]]);
    });
    double worst = 0;
    for (std::size_t i = 0; i < particles_.size(); ++i) {
      if (stiffness[i] <= 0) continue;
      const double mass = particles_.velocity[i].w, omega = std::sqrt(stiffness[i] / mass);
      const double zeta = dashpot[i] / (2 * mass * omega);
      worst = std::max(worst, step * omega / (2 * (std::sqrt(1 + zeta * zeta) - zeta)));
    }
    return worst;
  }

 private:
  using Parameters = typename Model::Parameters;
  static constexpr std::size_t history_bytes = Model::has_history ? sizeof(Record) : 0;
  static constexpr bool rotating = Model::has_friction || Model::has_rolling;
  static constexpr std::size_t batch_size = 256;

  // Forces on the walls, summed over steps.
  struct Accumulator {
    std::vector<Vec3> vertex_force, wall_force, couple;
    void each(const Accumulator& other, auto&& action) {
      for (std::size_t k = 0; k < vertex_force.size(); ++k) action(vertex_force[k], other.vertex_force[k]);
      for (std::size_t k = 0; k < wall_force.size(); ++k) action(wall_force[k], other.wall_force[k]);
      for (std::size_t k = 0; k < couple.size(); ++k) action(couple[k], other.couple[k]);
    }
    void scale_from(const Accumulator& other, double factor) {
      each(other, [&](Vec3& mine, const Vec3& theirs) { mine = factor * theirs; });
    }
    void add(const Accumulator& other, double factor) {
      each(other, [&](Vec3& mine, const Vec3& theirs) { mine += factor * theirs; });
    }
    void clear() { scale_from(*this, 0); }
  };

  // A contact with a wall that carries history.
  struct Held {
    std::uint32_t element;
    Vec3 point, normal;
    Record history;  // a SpringHistory
  };

  struct Candidate {
    std::uint32_t i, j, slot;
  };

  // Touching pairs of one pair of materials.
  struct Batch {
    std::array<Candidate, batch_size + 4> candidates;
    std::size_t count = 0;
  };

  void set_domain(const Scene& scene) {
    if (scene.domain) {
      domain_ = *scene.domain;
      return;
    }
    // Everything the case names, and half as much again around it.
    Vec3 low = Vec3::Constant(1e300), high = -low;
    const auto include = [&](const Vec3& a, const Vec3& b) {
      low = low.cwiseMin(a);
      high = high.cwiseMax(b);
    };
    for (const auto& insertion : scene.insertions) include(insertion.low, insertion.high);
    for (const auto& p : particles_.position) include(p.vector(), p.vector());
    if (const auto* box = walls_.bounds()) include(box->low, box->high);
    const Vec3 margin = Vec3::Constant(0.5 * (high - low).maxCoeff() + 10 * largest_);
    domain_ = {low - margin, high + margin};
  }

  void start(double step) {
    rebuild();
    evaluate(step, edge_);
    for (std::size_t i = 0; i < particles_.size(); ++i) {
      particles_.acceleration[i].set(particles_.force[i].vector() / particles_.velocity[i].w + gravity_);
      if constexpr (rotating) particles_.angular_acceleration[i].set(particles_.torque[i].vector() / particles_.spin[i].w);
    }
    started_ = true;
  }

  void begin_step(double step) {
    const double half = 0.5 * step * step;
    double farthest = 0, fastest = 0;
    for (std::size_t i = 0; i < particles_.size(); ++i) {
      auto &x = particles_.position[i], &v = particles_.velocity[i];
      const auto& a = particles_.acceleration[i];
      const double dx = v.x * step + a.x * half, dy = v.y * step + a.y * half, dz = v.z * step + a.z * half;
      x.x += dx;
      x.y += dy;
      x.z += dz;
      v.x += a.x * step;
      v.y += a.y * step;
      v.z += a.z * step;
      const auto& r = reference_[i];
      const double mx = x.x - r.x, my = x.y - r.y, mz = x.z - r.z;
      // Written so that a coordinate that is not a number counts as far.
      const double moved = mx * mx + my * my + mz * mz, travel = dx * dx + dy * dy + dz * dz;
      farthest = moved <= farthest ? farthest : moved;
      fastest = travel <= fastest ? fastest : travel;
    }
    if constexpr (rotating)
      for (std::size_t i = 0; i < particles_.size(); ++i) {
        auto& w = particles_.spin[i];
        const auto& a = particles_.angular_acceleration[i];
        w.x += a.x * step;
        w.y += a.y * step;
        w.z += a.z * step;
      }
    if (!(fastest < 0.25 * smallest_ * smallest_)) stop_at_fastest(step);
    if (!(4 * farthest < skin_ * skin_)) rebuild();
    else ++steps_since_rebuild_;
  }

  void end_step(double step) {
    const double half = 0.5 * step;
    for (std::size_t i = 0; i < particles_.size(); ++i) {
      auto &v = particles_.velocity[i], &a = particles_.acceleration[i];
      const auto& f = particles_.force[i];
      const double inverse = 1 / v.w;
      const double ax = f.x * inverse + gravity_[0], ay = f.y * inverse + gravity_[1], az = f.z * inverse + gravity_[2];
      v.x += (ax - a.x) * half;
      v.y += (ay - a.y) * half;
      v.z += (az - a.z) * half;
      a.x = ax;
      a.y = ay;
      a.z = az;
    }
    if constexpr (rotating)
      for (std::size_t i = 0; i < particles_.size(); ++i) {
        auto &w = particles_.spin[i], &a = particles_.angular_acceleration[i];
        const auto& t = particles_.torque[i];
        const double inverse = 1 / w.w;
        const double ax = t.x * inverse, ay = t.y * inverse, az = t.z * inverse;
        w.x += (ax - a.x) * half;
        w.y += (ay - a.y) * half;
        w.z += (az - a.z) * half;
        a.x = ax;
        a.y = ay;
        a.z = az;
      }
  }

  void evaluate(double step, Accumulator& loads) {
    std::fill(particles_.force.begin(), particles_.force.end(), Record{});
    if constexpr (rotating) std::fill(particles_.torque.begin(), particles_.torque.end(), Record{});
    pair_forces(step);
    wall_forces(step, loads);
  }

  // Touching pairs are gathered without branches on the forces, sorted by their pair of materials, and computed four at a
  // time: all lanes of a batch share their parameters.
  void pair_forces(double step) {
    touching_ = 0;
    if (materials_ == 1) find_touching([this](std::uint32_t, std::uint32_t) -> Batch& { return batches_[0]; }, step);
    else
      find_touching(
          [this](std::uint32_t i, std::uint32_t j) -> Batch& { return batches_[particles_.material[i] * materials_ + particles_.material[j]]; }, step);
    for (auto& batch : batches_) run_batch(batch, step);
  }

  template <class BatchOf>
  void find_touching(const BatchOf& batch_of, double step) {
    const auto n = static_cast<std::uint32_t>(particles_.size());
    const Record* const position = particles_.position.data();
    const std::uint32_t* const second = pairs_.second.data();
    [[maybe_unused]] std::uint8_t* const was_touching = was_touching_.data();
    for (std::uint32_t i = 0; i < n; ++i) {
      const Record a = position[i];
      const auto end = pairs_.start[i + 1];
      for (auto k = pairs_.start[i]; k < end; ++k) {
        const auto j = second[k];
        const Record& b = position[j];
        const double dx = a.x - b.x, dy = a.y - b.y, dz = a.z - b.z, reach = a.w + b.w;
        const bool touches = dx * dx + dy * dy + dz * dz < reach * reach;
        if constexpr (Model::has_history) {
          if (was_touching[k] > touches) history_[k] = Record{};  // it has just ended
          was_touching[k] = touches;
        }
        auto& batch = batch_of(i, j);
        const auto count = batch.count;
        batch.candidates[count] = {i, j, k};
        batch.count = count + touches;
        if (count + touches == batch_size) run_batch(batch, step);
      }
    }
  }

  void run_batch(Batch& batch, double step) {
    touching_ += batch.count;
    const auto& parameters = parameters_[static_cast<std::size_t>(&batch - batches_.data())];
    std::size_t c = 0;
    for (; c + 4 <= batch.count; c += 4) respond_to_four(&batch.candidates[c], 4, parameters, step);
    if (c < batch.count) {  // the last few: spare lanes repeat the first of them and are thrown away
      for (std::size_t spare = batch.count; spare < c + 4; ++spare) batch.candidates[spare] = batch.candidates[c];
      respond_to_four(&batch.candidates[c], batch.count - c, parameters, step);
    }
    batch.count = 0;
  }

  static Record4 gather(const std::vector<Record>& records, const Candidate* four, std::uint32_t Candidate::*which) {
    return transposed(as_vector(records[four[0].*which]), as_vector(records[four[1].*which]), as_vector(records[four[2].*which]),
                      as_vector(records[four[3].*which]));
  }
  static void scatter(std::vector<Record>& records, const Candidate* four, std::size_t lanes, std::uint32_t Candidate::*which,
                      const Vector3<Double4>& values) {
    const auto rows = transposed(values.x.v, values.y.v, values.z.v, Double4(0.0).v);
    const Double4* row[] = {&rows.x, &rows.y, &rows.z, &rows.w};
    for (std::size_t lane = 0; lane < lanes; ++lane) as_vector(records[four[lane].*which]) += row[lane]->v;
  }

  void respond_to_four(const Candidate* four, std::size_t lanes, const Parameters& parameters, double step) {
    const auto a = gather(particles_.position, four, &Candidate::i), b = gather(particles_.position, four, &Candidate::j);
    const auto v = gather(particles_.velocity, four, &Candidate::i), u = gather(particles_.velocity, four, &Candidate::j);
    Kinematics<Double4> k;
    const Vector3<Double4> line(a.x - b.x, a.y - b.y, a.z - b.z);
    const Double4 distance = sqrt(dot(line, line));
    k.normal = (Double4(1) / distance) * line;
    k.overlap = a.w + b.w - distance;
    k.step = step;
    k.reduced_radius = a.w * b.w / (a.w + b.w);
    k.reduced_mass = v.w * u.w / (v.w + u.w);
    const Vector3<Double4> relative(v.x - u.x, v.y - u.y, v.z - u.z);
    const Double4 along = dot(relative, k.normal);
    k.closing_speed = -along;
    const Double4 arm_i = a.w - 0.5 * k.overlap, arm_j = b.w - 0.5 * k.overlap;  // both end at the contact point
    if constexpr (rotating) {
      const auto w = gather(particles_.spin, four, &Candidate::i), q = gather(particles_.spin, four, &Candidate::j);
      const Vector3<Double4> spin_i(w.x, w.y, w.z), spin_j(q.x, q.y, q.z);
      // v + ω × (−arm n) on i, v + ω × (arm n) on j
      k.slip = relative - along * k.normal - cross(arm_i * spin_i + arm_j * spin_j, k.normal);
      k.mean_spin = 0.5 * (spin_i + spin_j);
      k.relative_spin = spin_i - spin_j;
      if constexpr (Model::has_rolling) k.reduced_inertia = w.w * q.w / (w.w + q.w);
    }
    SpringHistory<Double4> history;
    if constexpr (Model::has_history) {
      const auto h = gather(history_, four, &Candidate::slot);
      history = {{h.x, h.y, h.z}, h.w};
    }
    const auto r = Model::respond(k, parameters, history);
    if constexpr (Model::has_history) {
      const auto rows = transposed(history.force.x.v, history.force.y.v, history.force.z.v, history.stiffness.v);
      const Double4* row[] = {&rows.x, &rows.y, &rows.z, &rows.w};
      for (std::size_t lane = 0; lane < lanes; ++lane) as_vector(history_[four[lane].slot]) = row[lane]->v;
    }
    scatter(particles_.force, four, lanes, &Candidate::i, r.force);
    scatter(particles_.force, four, lanes, &Candidate::j, -r.force);
    if constexpr (rotating) {
      const Vector3<Double4> turn = cross(k.normal, r.force);
      Vector3<Double4> on_i = -(arm_i * turn), on_j = -(arm_j * turn);
      if constexpr (Model::has_rolling) {
        on_i = on_i + r.torque;
        on_j = on_j - r.torque;
      }
      scatter(particles_.torque, four, lanes, &Candidate::i, on_i);
      scatter(particles_.torque, four, lanes, &Candidate::j, on_j);
    }
  }

  Kinematics<double> still(std::uint32_t i, double overlap) const {  // of i against a wall at rest, without motion
    Kinematics<double> k{};
    k.overlap = overlap;
    k.reduced_radius = particles_.position[i].w;
    k.reduced_mass = particles_.velocity[i].w;
    if constexpr (Model::has_rolling) k.reduced_inertia = particles_.spin[i].w;
    return k;
  }

  Kinematics<double> still(std::uint32_t i, std::uint32_t j, double overlap) const {
    Kinematics<double> k{};
    const double r_i = particles_.position[i].w, r_j = particles_.position[j].w;
    const double m_i = particles_.velocity[i].w, m_j = particles_.velocity[j].w;
    k.overlap = overlap;
    k.reduced_radius = r_i * r_j / (r_i + r_j);
    k.reduced_mass = m_i * m_j / (m_i + m_j);
    return k;
  }

  void wall_forces(double step, Accumulator& loads) {
    wall_contacts_ = 0;
    if constexpr (Model::has_history) {
      held_next_.clear();
      held_start_next_.assign(1, 0);
    }
    for (std::size_t w = 0; w < near_wall_.size(); ++w) {
      const auto i = near_wall_[w];
      found_.clear();
      const Vec3 centre = particles_.position[i].vector();
      const double radius = particles_.position[i].w;
      NearestPoint nearest;
      for (auto e = wall_start_[w]; e < wall_start_[w + 1]; ++e)
        if (walls_.touches(wall_element_[e], centre, radius, nearest)) found_.push_back(nearest);
      if (!found_.empty()) touch_walls(w, i, radius, step, loads);
      if constexpr (Model::has_history) held_start_next_.push_back(static_cast<std::uint32_t>(held_next_.size()));
    }
    if constexpr (Model::has_history) {
      held_.swap(held_next_);
      held_start_.swap(held_start_next_);
    }
  }

  void touch_walls(std::size_t w, std::uint32_t i, double radius, double step, Accumulator& loads) {
    keep_contacts(walls_, radius, found_);
    weights_.resize(found_.size());
    share_creases(radius, found_, weights_);
    const auto first_held = held_next_.size();
    if constexpr (Model::has_history) inherit(w, radius);
    for (std::size_t c = 0; c < found_.size(); ++c) {
      const auto& contact = found_[c];
      if (!(contact.distance > 0.05 * radius)) stop_at_wall(i, contact);
      const auto k = at_wall(i, contact, radius, step);
      const auto wall = walls_.wall_of(contact.element);
      const auto& p = parameters_[particles_.material[i] * materials_ + wall_material_[wall]];
      SpringHistory<double> history{};
      if constexpr (Model::has_history) history = spring(held_next_[first_held + c].history);
      const auto r = Model::respond(k, p, history);
      if constexpr (Model::has_history) held_next_[first_held + c].history = stored(history);
      const Vec3 force = weights_[c] * r.force.vector();
      particles_.force[i].add(force);
      if constexpr (rotating) {
        Vec3 torque = -contact.distance * contact.normal.cross(force);
        if constexpr (Model::has_rolling) torque += weights_[c] * r.torque.vector();
        particles_.torque[i].add(torque);
      }
      // The force acts at the nearest point, which lies on the element: the barycentric weights carry force and moment.
      loads.wall_force[wall] -= force;
      if (walls_.is_triangle(contact.element)) {
        const auto& corners = walls_.triangle(contact.element);
        for (std::size_t n = 0; n < 3; ++n) loads.vertex_force[corners[n]] -= contact.weights[n] * force;
        if constexpr (Model::has_rolling) loads.couple[contact.element] -= weights_[c] * r.torque.vector();
      }
    }
    wall_contacts_ += found_.size();
  }

  // The contact point moves with the particle; the wall is at rest.
  Kinematics<double> at_wall(std::uint32_t i, const NearestPoint& contact, double radius, double step) const {
    auto k = still(i, radius - contact.distance);
    k.step = step;
    k.normal = Vector3<double>(contact.normal);
    const Vector3<double> velocity(particles_.velocity[i].vector());
    const double along = dot(velocity, k.normal);
    k.closing_speed = -along;
    if constexpr (rotating) {
      const Vector3<double> spin(particles_.spin[i].vector());
      k.slip = velocity - along * k.normal - cross(contact.distance * spin, k.normal);
      k.mean_spin = 0.5 * spin;
      k.relative_spin = spin;
    }
    return k;
  }

  static SpringHistory<double> spring(const Record& record) { return {{record.x, record.y, record.z}, record.w}; }
  static Record stored(const SpringHistory<double>& history) {
    return {history.force.x, history.force.y, history.force.z, history.stiffness};
  }

  // Gives every contact of particle w its history: its own element's, else that of a contact of the same wall that the
  // particle has left (it moved across an edge), else a share of a contact it shares a crease with.
  void inherit(std::size_t w, double radius) requires(Model::has_history) {
    const auto first = held_start_[w], last = held_start_[w + 1];
    used_.assign(last - first, false);
    const auto own = held_next_.size();
    constexpr auto none = static_cast<std::uint32_t>(-1);
    origin_.assign(found_.size(), none);
    for (std::size_t c = 0; c < found_.size(); ++c)
      for (auto h = first; h < last; ++h)
        if (held_[h].element == found_[c].element && !used_[h - first]) {
          origin_[c] = h;
          used_[h - first] = true;
        }
    for (std::size_t c = 0; c < found_.size(); ++c) {
      if (origin_[c] != none) continue;
      double nearest = radius * radius;
      for (auto h = first; h < last; ++h) {
        const double square = (held_[h].point - found_[c].point).squaredNorm();
        if (!used_[h - first] && square < nearest && held_[h].normal.dot(found_[c].normal) > 0.5 &&
            walls_.wall_of(held_[h].element) == walls_.wall_of(found_[c].element)) {
          nearest = square;
          origin_[c] = h;
        }
      }
      if (origin_[c] != none) used_[origin_[c] - first] = true;
    }
    for (std::size_t c = 0; c < found_.size(); ++c)
      held_next_.push_back({found_[c].element, found_[c].point, found_[c].normal,
                            origin_[c] == none ? Record{} : held_[origin_[c]].history});
    for (std::size_t c = 0; c < found_.size(); ++c) {
      if (origin_[c] != none) continue;
      for (std::size_t other = 0; other < found_.size(); ++other) {
        if (origin_[other] == none) continue;
        const double share = crease_share(radius, found_[c], found_[other]);
        if (share > 0) {
          held_next_[own + c].history = held_next_[own + other].history;
          auto& history = held_next_[own + c].history;
          history.set(share * history.vector());
          break;
        }
      }
    }
  }

  // Lists who is near whom, in an order that keeps neighbours in memory together, and carries the histories over.
  void rebuild() {
    for (std::size_t i = 0; i < particles_.size(); ++i)
      if (const Vec3 x = particles_.position[i].vector();
          !((x - domain_.low).minCoeff() >= 0 && (domain_.high - x).minCoeff() >= 0))
        throw std::runtime_error(fmt::format(
            "particle {} left the domain at t = {:.6g} s: it is at ({:.4g}, {:.4g}, {:.4g}) m. Close the walls, shorten the step, or "
            "widen `domain`.", particles_.id[i], time_, x[0], x[1], x[2]));
    // The skin follows the motion: a list that lasts long may be tighter, one that does not must be looser.
    if (rebuilds_ > 0) {
      if (steps_since_rebuild_ < 10) skin_ = std::min(1.2 * skin_, 0.8 * smallest_);
      else if (steps_since_rebuild_ > 50) skin_ = std::max(0.85 * skin_, 0.08 * smallest_);
    }
    steps_since_rebuild_ = 0;

    collect_histories();
    cells_.build(particles_.position, 2 * largest_ + skin_);
    if (rebuilds_ % 16 == 0) {
      sort_particles();
      cells_.build(particles_.position, 2 * largest_ + skin_);
    }
    cells_.find_pairs(particles_.position, skin_, pairs_);
    if constexpr (Model::has_history) {
      history_.assign(pairs_.size(), Record{});
      was_touching_.assign(pairs_.size(), 0);
    }
    find_walls();
    restore_histories();
    reference_.resize(particles_.size());
    for (std::size_t i = 0; i < particles_.size(); ++i) reference_[i] = particles_.position[i];
    ++rebuilds_;
  }

  void sort_particles() {
    const auto& order = cells_.order();
    particles_.reorder(order);
    if constexpr (Model::has_history) {
      std::vector<std::uint32_t> place(order.size());
      for (std::uint32_t k = 0; k < order.size(); ++k) place[order[k]] = k;
      for (auto& saved : saved_pairs_) {
        saved.i = place[saved.i];
        saved.j = place[saved.j];
      }
      for (auto& saved : saved_walls_) saved.first = place[saved.first];
    }
  }

  struct SavedPair {
    std::uint32_t i, j;
    Record history;  // a SpringHistory
  };

  void collect_histories() {
    if constexpr (Model::has_history) {
      saved_pairs_.clear();
      saved_walls_.clear();
      if (rebuilds_ == 0) return;
      for (std::uint32_t i = 0; i + 1 < pairs_.start.size(); ++i)
        for (auto k = pairs_.start[i]; k < pairs_.start[i + 1]; ++k)
          if (was_touching_[k]) saved_pairs_.push_back({i, pairs_.second[k], history_[k]});
      for (std::size_t w = 0; w < near_wall_.size(); ++w)
        for (auto h = held_start_[w]; h < held_start_[w + 1]; ++h) saved_walls_.emplace_back(near_wall_[w], held_[h]);
    }
  }

  void restore_histories() {
    if constexpr (Model::has_history) {
      const auto restore = [&](std::uint32_t i, std::uint32_t j, const Record& history) {
        for (auto k = pairs_.start[i]; k < pairs_.start[i + 1]; ++k)
          if (pairs_.second[k] == j) {
            history_[k] = history;
            was_touching_[k] = 1;
            return true;
          }
        return false;
      };
      for (auto& saved : saved_pairs_) {
        if (restore(saved.i, saved.j, saved.history)) continue;
        saved.history.set(-saved.history.vector());  // the pair stands the other way round now
        restore(saved.j, saved.i, saved.history);
      }
      std::stable_sort(saved_walls_.begin(), saved_walls_.end(),
                       [](const auto& a, const auto& b) { return a.first < b.first; });
      held_.clear();
      held_start_.assign(1, 0);
      std::size_t next = 0;
      for (const auto i : near_wall_) {  // ascending, like saved_walls_
        while (next < saved_walls_.size() && saved_walls_[next].first < i) ++next;
        for (; next < saved_walls_.size() && saved_walls_[next].first == i; ++next) held_.push_back(saved_walls_[next].second);
        held_start_.push_back(static_cast<std::uint32_t>(held_.size()));
      }
    }
  }

  void find_walls() {
    near_wall_.clear();
    wall_element_.clear();
    wall_start_.assign(1, 0);
    if (walls_.empty()) return;
    for (std::uint32_t i = 0; i < particles_.size(); ++i) {
      const auto before = wall_element_.size();
      walls_.find_near(particles_.position[i].vector(), particles_.position[i].w + 0.5 * skin_, wall_element_);
      if (wall_element_.size() == before) continue;
      near_wall_.push_back(i);
      wall_start_.push_back(static_cast<std::uint32_t>(wall_element_.size()));
    }
  }

  void finish_load(double steps) {
    for (std::size_t k = 0; k < load_.vertex_force.size(); ++k) load_.vertex_force[k] = accumulator_.vertex_force[k] / steps;
    for (std::size_t k = 0; k < load_.wall_force.size(); ++k) load_.wall_force[k] = accumulator_.wall_force[k] / steps;
    load_.couples_lost = 0;
    for (std::uint32_t e = 0; e < accumulator_.couple.size(); ++e) {
      const Vec3 couple = accumulator_.couple[e] / steps;
      if (couple.isZero(0)) continue;
      const auto& corners = walls_.triangle(e);
      const std::array<Vec3, 3> points{walls_.vertices()[corners[0]], walls_.vertices()[corners[1]], walls_.vertices()[corners[2]]};
      std::array<Vec3, 3> forces;
      if (!geometry::couple_forces(points, couple, forces)) ++load_.couples_lost;
      for (std::size_t n = 0; n < 3; ++n) load_.vertex_force[corners[n]] += forces[n];
    }
  }

  template <class Action>
  void for_each_contact(Action&& action) const {
    for (std::uint32_t i = 0; i + 1 < pairs_.start.size(); ++i)
      for (auto k = pairs_.start[i]; k < pairs_.start[i + 1]; ++k) {
        const auto j = pairs_.second[k];
        const Record &a = particles_.position[i], &b = particles_.position[j];
        const double overlap = a.w + b.w - (a.vector() - b.vector()).norm();
        if (overlap > 0) action(i, j, overlap);
      }
  }

  template <class Action>
  void for_each_wall_overlap(Action&& action) const {
    NearestPoint nearest;
    std::vector<NearestPoint> found;
    for (std::size_t w = 0; w < near_wall_.size(); ++w) {
      const auto& p = particles_.position[near_wall_[w]];
      found.clear();
      for (auto e = wall_start_[w]; e < wall_start_[w + 1]; ++e)
        if (walls_.touches(wall_element_[e], p.vector(), p.w, nearest)) found.push_back(nearest);
      keep_contacts(walls_, p.w, found);
      for (const auto& contact : found) action(near_wall_[w], contact.element, p.w - contact.distance);
    }
  }

  [[noreturn]] void stop_at_fastest(double step) const {
    std::size_t worst = 0;
    double fastest = -1;
    for (std::size_t i = 0; i < particles_.size(); ++i) {
      const double speed = particles_.velocity[i].vector().norm();
      if (!(speed <= fastest)) {
        fastest = speed;
        worst = i;
        if (!(speed <= 1e300)) break;
      }
    }
    const Vec3 x = particles_.position[worst].vector();
    throw std::runtime_error(fmt::format(
        "particle {} moves {:.3g} m in one step of {:.3g} s at t = {:.6g} s, more than half the smallest radius; it is at ({:.4g}, {:.4g}, "
        "{:.4g}) m. The step is too long for this speed, or the run has become unstable: lower step_fraction.",
        particles_.id[worst], fastest * step, step, time_, x[0], x[1], x[2]));
  }

  [[noreturn]] void stop_at_wall(std::uint32_t i, const NearestPoint& contact) const {
    const Vec3 x = particles_.position[i].vector();
    throw std::runtime_error(fmt::format(
        "particle {} is pushed through wall {} at t = {:.6g} s: its centre at ({:.4g}, {:.4g}, {:.4g}) m has reached the surface. The "
        "contact is too soft for this load: raise the particles' stiffness or lower the speed.",
        particles_.id[i], walls_.walls()[walls_.wall_of(contact.element)].name, time_, x[0], x[1], x[2]));
  }

  Vec3 gravity_;
  std::size_t materials_;
  std::vector<Parameters> parameters_;
  std::vector<Batch> batches_;  // one a pair of materials, like parameters_
  std::vector<PairProperties> pair_properties_;
  std::vector<std::uint8_t> wall_material_;
  Particles particles_;
  WallSet walls_;
  geometry::Box domain_;
  double smallest_ = 0, largest_ = 0, skin_ = 0, time_ = 0;
  bool started_ = false;

  CellGrid cells_;
  PairList pairs_;
  std::vector<Record> history_;             // SpringHistory beside pairs_.second; empty without history
  std::vector<std::uint8_t> was_touching_;  // likewise
  std::vector<Record> reference_;           // positions at the last rebuild
  std::uint64_t rebuilds_ = 0, steps_since_rebuild_ = 0;
  std::size_t touching_ = 0, wall_contacts_ = 0;

  std::vector<std::uint32_t> near_wall_, wall_start_, wall_element_;  // particles near walls, and elements of each (CSR)
  std::vector<Held> held_, held_next_;                                // histories with walls, by near_wall_ (CSR)
  std::vector<std::uint32_t> held_start_, held_start_next_, origin_;
  std::vector<bool> used_;
  std::vector<NearestPoint> found_;
  std::vector<double> weights_;
  std::vector<SavedPair> saved_pairs_;
  std::vector<std::pair<std::uint32_t, Held>> saved_walls_;
  Accumulator accumulator_, edge_;
  WallLoad load_;
};

}  // namespace acopla::dem
