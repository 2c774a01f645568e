// The kernel of one contact model: gathers a pack of contacts, asks the model, scatters its answer. Included by the files that
// instantiate laws: those of dem/kernels/, and a user's own.
#pragma once

#include "dem/kernel.h"

// Everything a loop over contacts calls becomes part of its body: a call in it would spill every register. Not under sanitizers, whose
// checks would make one body of it that takes minutes to compile.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define ACOPLA_ONE_BODY
#else
#define ACOPLA_ONE_BODY [[gnu::flatten]]
#endif

namespace acopla::dem {

template <class Model, int dimension>
class KernelOf final : public Kernel {
 public:
  explicit KernelOf(const PairProperties& pair) : parameters_(Model::from(pair)) {}

  void pairs(PairContacts& contacts, Particles& particles, Exports& exports, double step, ContactEnergy<double>* energy) const override {
    if (energy) all_pairs<true>(contacts, particles, exports, step, energy);
    else all_pairs<false>(contacts, particles, exports, step, energy);
  }

  void walls(WallContacts& contacts, Particles& particles, double step, ContactEnergy<double>* energy) const override {
    contacts.force.resize(contacts.normal.size());
    if (Model::has_rolling) contacts.torque.resize(contacts.normal.size());
    if (energy) all_walls<true>(contacts, particles, step, energy);
    else all_walls<false>(contacts, particles, step, energy);
  }

  std::size_t history_size() const override { return numbers; }
  std::span<const double> swap_signs() const override {
    static constexpr auto signs = Model::template swap_signs<Pack>();
    return {signs.data(), signs.size()};
  }
  bool rotates() const override { return Model::rotates; }
  bool rolls() const override { return Model::has_rolling; }

  ContactStiffness stiffness(double overlap, double reduced_radius, double reduced_mass, double rolling_inertia) const override {
    One k{};
    k.overlap = overlap;
    k.reduced_radius = reduced_radius;
    k.reduced_mass = reduced_mass;
    k.rolling_inertia = rolling_inertia;
    ContactStiffness result;
    if constexpr (requires { Model::Normal::steepest(k, parameters_.normal); }) result.normal = Model::Normal::steepest(k, parameters_.normal);
    else result.normal = Model::Normal::stiffness(k, parameters_.normal);
    if constexpr (requires { Model::Normal::dashpot(k, parameters_.normal); }) result.normal_dashpot = Model::Normal::dashpot(k, parameters_.normal);
    if constexpr (Model::has_friction) {
      result.shear = Model::Tangential::template stiffness<typename Model::Normal>(k, parameters_.tangential, parameters_.normal);
      result.shear_dashpot = Model::Tangential::template dashpot<typename Model::Normal>(k, parameters_.tangential, parameters_.normal);
    }
    if constexpr (Model::has_rolling) {
      if constexpr (requires { Model::Rolling::stiffness(k, result.shear, parameters_.rolling); }) {
        result.rolling = Model::Rolling::stiffness(k, result.shear, parameters_.rolling);
        result.rolling_dashpot = Model::Rolling::dashpot(k, result.shear, parameters_.rolling);
      }
      if constexpr (requires { parameters_.rolling.twisting; }) result.twisting = parameters_.rolling.twisting;
      if constexpr (requires { Model::Rolling::share; }) result.spin_share = Model::Rolling::share;
    }
    return result;
  }

 private:
  using Pack = Kinematics<DoublePack, dimension>;
  using One = Kinematics<double, dimension>;
  using Turn = typename Pack::Turn;
  using History = typename Model::template History<Pack>;
  static constexpr std::size_t numbers = Model::template history_size<Pack>();
  static_assert(sizeof(History) == numbers * sizeof(DoublePack), "a law's History holds what its `stored` lists");

  // One body of a pack of contacts.
  struct Body {
    RecordPack position, velocity, spin;
  };

  static Body body(const Particles& particles, const std::uint32_t* which) {
    Body b;
    b.position = gathered(particles.position.data(), which);
    b.velocity = gathered(particles.velocity.data(), which);
    if constexpr (dimension == 3 && Model::rotates) b.spin = gathered(particles.spin.data(), which);
    return b;
  }

  static Turn spin_of(const Body& b) {
    if constexpr (dimension == 2) return {b.velocity.z};
    else return {b.spin.x, b.spin.y, b.spin.z};
  }
  static Turn spins(const Particles& particles, const std::uint32_t* which) {
    if constexpr (dimension == 2) return {gathered(particles.velocity.data(), which).z};
    else {
      RecordPack spin = gathered(particles.spin.data(), which);
      return {spin.x, spin.y, spin.z};
    }
  }
  static Vector<DoublePack, dimension> first_of(const PairPack& pair) {
    if constexpr (dimension == 2) return {pair.x, pair.y};
    else return {pair.x, pair.y, pair.z};
  }
  static Vector<DoublePack, dimension> velocity_of(const Body& b) {
    if constexpr (dimension == 2) return {b.velocity.x, b.velocity.y};
    else return {b.velocity.x, b.velocity.y, b.velocity.z};
  }
  static DoublePack inertia_of(const Body& b) {
    if constexpr (dimension == 2) return 0.5 * b.velocity.w * b.position.w * b.position.w;
    else return b.spin.w;
  }

  // Surface velocity across the normal: relative velocity of the centres, and ω × arm on both sides.
  static Turn slip(const Vector<DoublePack, dimension>& relative, const DoublePack& along, const Turn& arms_times_spins, const Vector<DoublePack, dimension>& n) {
    if constexpr (dimension == 2) return {relative.y * n.x - relative.x * n.y - arms_times_spins.x};
    else return relative - along * n - cross(arms_times_spins, n);
  }

  // Normal and tangential force as one vector on i.
  template <class R, class Real>
  static Vector<Real, dimension> force_of(const R& r, const Vector<Real, dimension>& n) {
    Vector<Real, dimension> force = r.normal * n;
    if constexpr (Model::has_friction) {
      if constexpr (dimension == 2) force = {force.x - r.shear.x * n.y, force.y + r.shear.x * n.x};
      else force = force + r.shear;
    }
    return force;
  }
  // n × force: the torque of a unit arm along the normal.
  template <class R, class Real>
  static Vector<Real, Pack::turns> turning_of(const R& r, const Vector<Real, dimension>& n) {
    if constexpr (!Model::has_friction) return zero_vector<Real, Pack::turns>();
    else if constexpr (dimension == 2) return r.shear;
    else return cross(n, r.shear);
  }

  // Force, and in the plane the torque beside it.
  static RecordPack with_torque(const Vector<DoublePack, dimension>& force, const Turn& torque) {
    if constexpr (dimension == 2) return {force.x, force.y, torque.x, DoublePack(0.0)};
    else return {force.x, force.y, force.z, DoublePack(0.0)};
  }
  static RecordPack record_of(const Turn& torque) {
    if constexpr (dimension == 2) return {DoublePack(0.0), DoublePack(0.0), torque.x, DoublePack(0.0)};
    else return {torque.x, torque.y, torque.z, DoublePack(0.0)};
  }

  // Histories of lanes that do not touch are forgotten.
  static void keep_while_touching(HistoryLane* stored, const Pack& k) {
    const auto touches = k.overlap > DoublePack(0.0);
    for (std::size_t n = 0; n < numbers; ++n) store(stored[n].value, select(touches, load(stored[n].value), DoublePack(0.0)));
  }

  static void add(ContactEnergy<double>& total, const ContactEnergy<DoublePack>& pack, const DoublePack& weight) {
    total.normal += sum(weight * pack.normal);
    total.tangential += sum(weight * pack.tangential);
    total.rolling += sum(weight * pack.rolling);
    total.normal_dashpot += sum(weight * pack.normal_dashpot);
    total.tangential_work += sum(weight * pack.tangential_work);
    total.rolling_work += sum(weight * pack.rolling_work);
  }
  template <bool ledger>
  static typename Model::template Response<Pack> answer(Pack& k, const typename Model::Parameters& parameters, HistoryLane* stored, const DoublePack& weight,
                                                        ContactEnergy<double>* total) {
    History& history = *reinterpret_cast<History*>(stored);
    const DoublePack half_step = k.closing_speed, before = history.closing_speed;
    k.closing_speed = select(before == DoublePack(0.0), half_step, 1.5 * half_step - 0.5 * before);
    history.closing_speed = half_step;
    typename Model::template Response<Pack> r;
    if constexpr (ledger) {
      using std::max;
      ContactEnergy<DoublePack> energy;
      // A force works over the mean of the half steps before and after it. What all forces on the two bodies do in a step is known from the
      // last one, so only the change of this force since then is missing: its value then, with the overlap and the speed of then.
      const auto is_new = before == DoublePack(0.0);
      Pack then = k;
      then.overlap = max(DoublePack(0.0), k.overlap - k.step * half_step);
      then.closing_speed = before;
      auto normal_history = history.normal;
      const DoublePack earlier = select(is_new, DoublePack(0.0), Model::Normal::force(then, parameters.normal, normal_history));
      r = Model::respond(k, parameters, history, &energy);
      // In the tangential direction the whole force is taken for its change: 1 + m r²/I is 3 for discs, 3.5 for spheres.
      constexpr double turning = dimension == 2 ? 3 : 3.5;
      const DoublePack late = 0.5 * k.step / k.reduced_mass;
      energy.normal_dashpot = energy.normal_dashpot - energy.viscous * late * (r.normal - earlier);
      energy.tangential_work = energy.tangential_work - (k.step * turning) * late * energy.viscous_shear;
      add(*total, energy, weight);
    } else {
      r = Model::respond(k, parameters, history, static_cast<ContactEnergy<DoublePack>*>(nullptr));
    }
    keep_while_touching(stored, k);
    return r;
  }

  // A pack of pairs before its law is asked.
  struct Meeting {
    Pack kinematics;
    DoublePack arm_i, arm_j;  // from the centres to the contact point
  };

  static void meet(const Particles& particles, const std::uint32_t* i, const std::uint32_t* j, double step, Meeting& meeting) {
    using std::max, std::sqrt;
    PairPack positions = gathered(particles.position.data(), i, j), velocities = gathered(particles.velocity.data(), i, j);
    Pack k;
    k.step = step;
    auto between = first_of(positions), relative = first_of(velocities);
    const DoublePack distance = sqrt(dot(between, between)), radii = positions.sum_w, masses = velocities.sum_w;
    // One division for three quotients: 1/d, r r/(r + r), m m/(m + m).
    const DoublePack sums = radii * masses, inverse = 1.0 / (distance * sums), inverse_sums = distance * inverse;
    k.normal = (sums * inverse) * between;
    k.overlap = max(DoublePack(0.0), radii - distance);
    k.reduced_radius = positions.product_w * masses * inverse_sums;
    k.reduced_mass = velocities.product_w * radii * inverse_sums;
    const DoublePack along = dot(relative, k.normal);
    k.closing_speed = -along;
    if constexpr (Model::rotates) {
      meeting.arm_i = positions.first_w - 0.5 * k.overlap;
      meeting.arm_j = (radii - positions.first_w) - 0.5 * k.overlap;
      Turn spin_i = spins(particles, i), spin_j = spins(particles, j);
      k.slip = slip(relative, along, meeting.arm_i * spin_i + meeting.arm_j * spin_j, k.normal);
      if constexpr (dimension == 3) k.frame_spin = 0.5 * dot(spin_i + spin_j, k.normal);
      if constexpr (Model::has_rolling) {
        k.relative_spin = spin_i - spin_j;
        set_inertias(k, body(particles, i), body(particles, j));
      }
    }
    meeting.kinematics = k;
  }

  // Some packs meet before the first is answered, and all are answered before the first pushes its particles. A pack is one long chain of
  // roots and quotients, and the processor cannot look far enough ahead to begin the next one meanwhile; the shorter chains of one kind overlap.
  static constexpr std::size_t ahead = 8;

  template <bool ledger>
  ACOPLA_ONE_BODY void all_pairs(PairContacts& contacts, Particles& particles, Exports& exports, double step, ContactEnergy<double>* energy) const {
    const auto parameters = parameters_;  // a copy, which nothing that is written can change
    Meeting meetings[ahead];
    Push pushes[ahead];
    for (std::size_t begin = 0; begin < contacts.size; begin += ahead * lanes) {
      const auto end = std::min(begin + ahead * lanes, contacts.size);
      for (std::size_t c = begin; c < end; c += lanes) meet(particles, &contacts.i[c], &contacts.j[c], step, meetings[(c - begin) / lanes]);
      for (std::size_t c = begin; c < end; c += lanes) {
        HistoryLane* const stored = &contacts.history[c / lanes * numbers];
        const DoublePack weight = ledger ? first_lanes(std::min(lanes, contacts.size - c)) : DoublePack(1.0);
        push<ledger>(meetings[(c - begin) / lanes], parameters, stored, weight, energy, pushes[(c - begin) / lanes]);
      }
      for (std::size_t c = begin; c < end; c += lanes) {
        const Push& p = pushes[(c - begin) / lanes];
        const Meeting& m = meetings[(c - begin) / lanes];
        const auto count = std::min(lanes, contacts.size - c);
        if (contacts.exports) push_one(particles, contacts, exports, c, count, p, m);
        else push_both(particles, contacts, c, count, p, m);
      }
    }
  }

  // What a pack of pairs does to its particles: the force on i, the opposite on j, and on both the torque −arm × turning; rolling turns i,
  // and j the other way.
  struct Push {
    Vector<DoublePack, dimension> force;
    Turn turning, rolling;
  };
  template <bool ledger>
  static void push(const Meeting& meeting, const typename Model::Parameters& parameters, HistoryLane* stored, const DoublePack& weight,
                   ContactEnergy<double>* energy, Push& push) {
    Pack k = meeting.kinematics;
    auto r = answer<ledger>(k, parameters, stored, weight, energy);
    push.force = force_of(r, k.normal);
    if constexpr (Model::rotates) {
      push.turning = turning_of(r, k.normal);
      if constexpr (Model::has_rolling) push.rolling = r.torque;
    }
  }

  // Both bodies take the same rows: the force's, and in space the turning's, which either multiplies by its arm.
  static void push_both(Particles& particles, const PairContacts& contacts, std::size_t c, std::size_t count, const Push& push, const Meeting& meeting) {
    const std::uint32_t *const i = &contacts.i[c], *const j = &contacts.j[c];
    if constexpr (dimension == 2) {
      add_to(particles.force.data(), i, count, with_torque(push.force, torque_on(push, meeting.arm_i, 1)));
      add_to(particles.force.data(), j, count, with_torque(-push.force, torque_on(push, meeting.arm_j, -1)));
    } else {
      Record *const force = particles.force.data(), *const torque = particles.torque.data();
      const simd::Rows forces(record_of(push.force));
      if constexpr (!Model::rotates) {
        simd::for_each_lane(count, [&](std::size_t lane) {
          forces.of(lane, [&](const auto& row) {
            simd::add(force[i[lane]], row);
            simd::add(force[j[lane]], -row);
          });
        });
      } else {
        const simd::Rows turnings(record_of(push.turning)), rollings(record_of(Model::has_rolling ? push.rolling : push.turning));
        const auto *const arm_i = reinterpret_cast<const double*>(&meeting.arm_i), *const arm_j = reinterpret_cast<const double*>(&meeting.arm_j);
        simd::for_each_lane(count, [&](std::size_t lane) {
          forces.of(lane, [&](const auto& row) {
            simd::add(force[i[lane]], row);
            simd::add(force[j[lane]], -row);
          });
          turnings.of(lane, [&](const auto& turning) {
            if constexpr (Model::has_rolling) {
              rollings.of(lane, [&](const auto& rolling) {
                simd::add(torque[i[lane]], rolling - turning * arm_i[lane]);
                simd::add(torque[j[lane]], -rolling - turning * arm_j[lane]);
              });
            } else {
              simd::add(torque[i[lane]], -(turning * arm_i[lane]));
              simd::add(torque[j[lane]], -(turning * arm_j[lane]));
            }
          });
        });
      }
    }
  }
  // The second body belongs to another partition.
  static void push_one(Particles& particles, const PairContacts& contacts, Exports& exports, std::size_t c, std::size_t count, const Push& push,
                       const Meeting& meeting) {
    add_forces(particles, &contacts.i[c], count, push.force, torque_on(push, meeting.arm_i, 1));
    Turn torque = torque_on(push, meeting.arm_j, -1);
    write(&exports.force[contacts.first_export + c], count, with_torque(-push.force, torque));
    if constexpr (dimension == 3 && Model::rotates) write(&exports.torque[contacts.first_export + c], count, record_of(torque));
  }
  static Turn torque_on(const Push& push, const DoublePack& arm, double sense) {
    if constexpr (!Model::rotates) return zero_vector<DoublePack, Pack::turns>();
    else if constexpr (Model::has_rolling) return DoublePack(sense) * push.rolling - arm * push.turning;
    else return -(arm * push.turning);
  }

  static void add_forces(Particles& particles, const std::uint32_t* which, std::size_t count, const Vector<DoublePack, dimension>& force, const Turn& torque) {
    add_to(particles.force.data(), which, count, with_torque(force, torque));
    if constexpr (dimension == 3 && Model::rotates) add_to(particles.torque.data(), which, count, record_of(torque));
  }
  static void set_inertias(Pack& k, const Body& a, const Body& b) {
    const DoublePack i = inertia_of(a), j = inertia_of(b);
    k.reduced_inertia = i * j / (i + j);
    const DoublePack at_i = i + a.velocity.w * a.position.w * a.position.w, at_j = j + b.velocity.w * b.position.w * b.position.w;
    k.rolling_inertia = at_i * at_j / (at_i + at_j);
  }

  template <bool ledger>
  ACOPLA_ONE_BODY void all_walls(WallContacts& contacts, Particles& particles, double step, ContactEnergy<double>* energy) const {
    using std::max;
    const auto parameters = parameters_;
    for (std::size_t c = 0; c < contacts.size; c += lanes) {
      const auto count = std::min(lanes, contacts.size - c);
      const std::uint32_t* i = &contacts.particle[c];
      Body a = body(particles, i);
      RecordPack normal = loaded(&contacts.normal[c]), wall = loaded(&contacts.velocity[c]);
      Pack k;
      k.step = step;
      Vector<DoublePack, dimension> relative;
      if constexpr (dimension == 2) {
        k.normal = {normal.x, normal.y};
        relative = velocity_of(a) - Vector<DoublePack, 2>{wall.x, wall.y};
      } else {
        k.normal = {normal.x, normal.y, normal.z};
        relative = velocity_of(a) - Vector<DoublePack, 3>{wall.x, wall.y, wall.z};
      }
      k.overlap = max(DoublePack(0.0), normal.w);
      k.reduced_radius = a.position.w;
      if (!contacts.curvature.empty()) k.reduced_radius = a.position.w / (1.0 + a.position.w * load(&contacts.curvature[c]));
      k.reduced_mass = a.velocity.w;
      const DoublePack along = dot(relative, k.normal);
      k.closing_speed = -along;
      const DoublePack arm = a.position.w - normal.w;  // to the contact point
      if constexpr (Model::rotates) {
        Turn spin = spin_of(a);
        k.slip = slip(relative, along, arm * spin, k.normal);
        if constexpr (dimension == 3) k.frame_spin = 0.5 * dot(spin, k.normal);
        k.relative_spin = spin;
        if (!contacts.wall_spin.empty()) {
          RecordPack turns = loaded(&contacts.wall_spin[c]);
          Turn wall_spin;
          if constexpr (dimension == 2) wall_spin = {turns.z};
          else wall_spin = {turns.x, turns.y, turns.z};
          if constexpr (dimension == 3) k.frame_spin = k.frame_spin + 0.5 * dot(wall_spin, k.normal);
          k.relative_spin = k.relative_spin - wall_spin;
        }
        if constexpr (Model::has_rolling) {
          k.reduced_inertia = inertia_of(a);
          k.rolling_inertia = k.reduced_inertia + a.velocity.w * a.position.w * a.position.w;
        }
      }
      HistoryLane* const stored = &contacts.history[c / lanes * numbers];
      auto r = answer<ledger>(k, parameters, stored, ledger ? wall.w * first_lanes(count) : DoublePack(1.0), energy);
      auto force = wall.w * force_of(r, k.normal);
      Turn torque = zero_vector<DoublePack, Pack::turns>();
      if constexpr (Model::rotates) torque = -((wall.w * arm) * turning_of(r, k.normal));
      if constexpr (Model::has_rolling) {
        Turn rolling = wall.w * r.torque;
        torque = torque + rolling;
        write(&contacts.torque[c], count, record_of(rolling));
      }
      write(&contacts.force[c], count, with_torque(force, zero_vector<DoublePack, Pack::turns>()));
      add_forces(particles, i, count, force, torque);
    }
  }

  typename Model::Parameters parameters_;
};

}  // namespace acopla::dem

#undef ACOPLA_ONE_BODY
