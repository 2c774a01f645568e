// The kernel of one contact model: gathers a pack of contacts, asks the model, scatters its answer. Included by the files that
// instantiate laws: those of dem/kernels/, and a user's own.
#pragma once

#include "dem/kernel.h"

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
    if constexpr (Model::has_rolling)
      if constexpr (requires { Model::Rolling::stiffness(k, result.shear, parameters_.rolling); }) {
        result.rolling = Model::Rolling::stiffness(k, result.shear, parameters_.rolling);
        result.rolling_dashpot = Model::Rolling::dashpot(k, result.shear, parameters_.rolling);
      }
    return result;
  }

 private:
  using Pack = Kinematics<Double4, dimension>;
  using One = Kinematics<double, dimension>;
  using Turn = typename Pack::Turn;
  using History = typename Model::template History<Pack>;
  static constexpr std::size_t numbers = Model::template history_size<Pack>();
  static_assert(numbers == 0 || sizeof(History) == numbers * sizeof(Double4), "a law's History holds what its `stored` lists");

  // One body of a pack of contacts.
  struct Body {
    Record4 position, velocity, spin;
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
  static Vector<Double4, dimension> velocity_of(const Body& b) {
    if constexpr (dimension == 2) return {b.velocity.x, b.velocity.y};
    else return {b.velocity.x, b.velocity.y, b.velocity.z};
  }
  static Double4 inertia_of(const Body& b) {
    if constexpr (dimension == 2) return 0.5 * b.velocity.w * b.position.w * b.position.w;
    else return b.spin.w;
  }

  // Surface velocity across the normal: relative velocity of the centres, and ω × arm on both sides.
  static Turn slip(const Vector<Double4, dimension>& relative, const Double4& along, const Turn& arms_times_spins, const Vector<Double4, dimension>& n) {
    if constexpr (dimension == 2) return {relative.y * n.x - relative.x * n.y - arms_times_spins.x};
    else return relative - along * n - cross(arms_times_spins, n);
  }

  // Normal and tangential force as one vector on i.
  static Vector<Double4, dimension> force_of(const typename Model::template Response<Pack>& r, const Vector<Double4, dimension>& n) {
    Vector<Double4, dimension> force = r.normal * n;
    if constexpr (Model::has_friction) {
      if constexpr (dimension == 2) force = {force.x - r.shear.x * n.y, force.y + r.shear.x * n.x};
      else force = force + r.shear;
    }
    return force;
  }
  // n × force: the torque of a unit arm along the normal.
  static Turn turning_of(const typename Model::template Response<Pack>& r, const Vector<Double4, dimension>& n) {
    if constexpr (!Model::has_friction) return zero_vector<Double4, Pack::turns>();
    else if constexpr (dimension == 2) return r.shear;
    else return cross(n, r.shear);
  }

  static void add_rows(Record* records, const std::uint32_t* which, std::size_t count, const Record4& rows) {
    const Double4* row[] = {&rows.x, &rows.y, &rows.z, &rows.w};
    for (std::size_t lane = 0; lane < count; ++lane) as_vector(records[which[lane]]) += row[lane]->v;
  }
  static void set_rows(Record* records, std::size_t count, const Record4& rows) {
    const Double4* row[] = {&rows.x, &rows.y, &rows.z, &rows.w};
    for (std::size_t lane = 0; lane < count; ++lane) as_vector(records[lane]) = row[lane]->v;
  }
  // Force, and in the plane the torque beside it.
  static Record4 force_rows(const Vector<Double4, dimension>& force, const Turn& torque) {
    const Double4 none(0.0);
    if constexpr (dimension == 2) return transposed(force.x.v, force.y.v, torque.x.v, none.v);
    else return transposed(force.x.v, force.y.v, force.z.v, none.v);
  }
  static Record4 torque_rows(const Turn& torque) {
    const Double4 none(0.0);
    if constexpr (dimension == 2) return transposed(none.v, none.v, torque.x.v, none.v);
    else return transposed(torque.x.v, torque.y.v, torque.z.v, none.v);
  }

  // Histories of lanes that do not touch are forgotten.
  static void keep_while_touching(HistoryLane* stored, const Pack& k) {
    if constexpr (numbers > 0) {
      const auto touches = k.overlap > Double4(0.0);
      for (std::size_t n = 0; n < numbers; ++n) store(stored[n].value, select(touches, load(stored[n].value), Double4(0.0)));
    }
  }

  static void add(ContactEnergy<double>& total, const ContactEnergy<Double4>& pack, const Double4& weight) {
    total.normal += sum(weight * pack.normal);
    total.tangential += sum(weight * pack.tangential);
    total.rolling += sum(weight * pack.rolling);
    total.normal_dashpot += sum(weight * pack.normal_dashpot);
    total.tangential_power += sum(weight * pack.tangential_power);
    total.rolling_power += sum(weight * pack.rolling_power);
  }
  // 1 in the lanes that count.
  static Double4 counting(std::size_t count) {
    return Double4(Double4::Vector{1.0, count > 1 ? 1.0 : 0.0, count > 2 ? 1.0 : 0.0, count > 3 ? 1.0 : 0.0});
  }

  template <bool ledger>
  typename Model::template Response<Pack> answer(const Pack& k, HistoryLane* stored, const Double4& weight, ContactEnergy<double>* total) const {
    History empty;
    History& history = numbers > 0 ? *reinterpret_cast<History*>(stored) : empty;
    typename Model::template Response<Pack> r;
    if constexpr (ledger) {
      ContactEnergy<Double4> energy;
      r = Model::respond(k, parameters_, history, &energy);
      add(*total, energy, weight);
    } else {
      r = Model::respond(k, parameters_, history, static_cast<ContactEnergy<Double4>*>(nullptr));
    }
    keep_while_touching(stored, k);
    return r;
  }

  template <bool ledger>
  void all_pairs(PairContacts& contacts, Particles& particles, Exports& exports, double step, ContactEnergy<double>* energy) const {
    using std::max, std::sqrt;
    for (std::size_t c = 0; c < contacts.size; c += lanes) {
      const auto count = std::min(lanes, contacts.size - c);
      const std::uint32_t *i = &contacts.i[c], *j = &contacts.j[c];
      const Body a = body(particles, i), b = body(particles, j);
      Pack k;
      k.step = step;
      Vector<Double4, dimension> between;
      if constexpr (dimension == 2) between = {a.position.x - b.position.x, a.position.y - b.position.y};
      else between = {a.position.x - b.position.x, a.position.y - b.position.y, a.position.z - b.position.z};
      const Double4 distance = sqrt(dot(between, between));
      const Double4 radii = a.position.w + b.position.w, masses = a.velocity.w + b.velocity.w;
      // One division for three quotients: 1/d, r r/(r + r), m m/(m + m).
      const Double4 sums = radii * masses, inverse = 1.0 / (distance * sums), inverse_sums = distance * inverse;
      k.normal = (sums * inverse) * between;
      k.overlap = max(Double4(0.0), radii - distance);
      k.reduced_radius = a.position.w * b.position.w * masses * inverse_sums;
      k.reduced_mass = a.velocity.w * b.velocity.w * radii * inverse_sums;
      const auto relative = velocity_of(a) - velocity_of(b);
      const Double4 along = dot(relative, k.normal);
      k.closing_speed = -along;
      const Double4 arm_i = a.position.w - 0.5 * k.overlap, arm_j = b.position.w - 0.5 * k.overlap;  // both end at the contact point
      if constexpr (Model::rotates) {
        const Turn spin_i = spin_of(a), spin_j = spin_of(b);
        k.slip = slip(relative, along, arm_i * spin_i + arm_j * spin_j, k.normal);
        k.mean_spin = Double4(0.5) * (spin_i + spin_j);
        k.relative_spin = spin_i - spin_j;
        if constexpr (Model::has_rolling) set_inertias(k, a, b);
      }
      HistoryLane* const stored = numbers > 0 ? &contacts.history[c / lanes * numbers] : nullptr;
      const auto r = answer<ledger>(k, stored, ledger ? counting(count) : Double4(1.0), energy);
      const auto force = force_of(r, k.normal);
      Turn on_i, on_j;
      if constexpr (Model::rotates) {
        const Turn turning = turning_of(r, k.normal);
        on_i = -(arm_i * turning);
        on_j = -(arm_j * turning);
        if constexpr (Model::has_rolling) {
          on_i = on_i + r.torque;
          on_j = on_j - r.torque;
        }
      } else {
        on_i = on_j = zero_vector<Double4, Pack::turns>();
      }
      add_rows(particles.force.data(), i, count, force_rows(force, on_i));
      if (contacts.exports) set_rows(&exports.force[contacts.first_export + c], count, force_rows(-force, on_j));
      else add_rows(particles.force.data(), j, count, force_rows(-force, on_j));
      if constexpr (dimension == 3 && Model::rotates) {
        add_rows(particles.torque.data(), i, count, torque_rows(on_i));
        if (contacts.exports) set_rows(&exports.torque[contacts.first_export + c], count, torque_rows(on_j));
        else add_rows(particles.torque.data(), j, count, torque_rows(on_j));
      }
    }
  }

  static void set_inertias(Pack& k, const Body& a, const Body& b) {
    const Double4 i = inertia_of(a), j = inertia_of(b);
    k.reduced_inertia = i * j / (i + j);
    const Double4 at_i = i + a.velocity.w * a.position.w * a.position.w, at_j = j + b.velocity.w * b.position.w * b.position.w;
    k.rolling_inertia = at_i * at_j / (at_i + at_j);
  }

  template <bool ledger>
  void all_walls(WallContacts& contacts, Particles& particles, double step, ContactEnergy<double>* energy) const {
    using std::max;
    for (std::size_t c = 0; c < contacts.size; c += lanes) {
      const auto count = std::min(lanes, contacts.size - c);
      const std::uint32_t* i = &contacts.particle[c];
      const Body a = body(particles, i);
      const Record4 normal = loaded(&contacts.normal[c]), wall = loaded(&contacts.velocity[c]);
      Pack k;
      k.step = step;
      Vector<Double4, dimension> relative;
      if constexpr (dimension == 2) {
        k.normal = {normal.x, normal.y};
        relative = velocity_of(a) - Vector<Double4, 2>{wall.x, wall.y};
      } else {
        k.normal = {normal.x, normal.y, normal.z};
        relative = velocity_of(a) - Vector<Double4, 3>{wall.x, wall.y, wall.z};
      }
      k.overlap = max(Double4(0.0), normal.w);
      k.reduced_radius = a.position.w;
      if (!contacts.curvature.empty()) k.reduced_radius = a.position.w / (1.0 + a.position.w * load(&contacts.curvature[c]));
      k.reduced_mass = a.velocity.w;
      const Double4 along = dot(relative, k.normal);
      k.closing_speed = -along;
      const Double4 arm = a.position.w - normal.w;  // to the contact point
      if constexpr (Model::rotates) {
        const Turn spin = spin_of(a);
        k.slip = slip(relative, along, arm * spin, k.normal);
        k.mean_spin = Double4(0.5) * spin;
        k.relative_spin = spin;
        if (!contacts.wall_spin.empty()) {
          const Record4 turns = loaded(&contacts.wall_spin[c]);
          Turn wall_spin;
          if constexpr (dimension == 2) wall_spin = {turns.z};
          else wall_spin = {turns.x, turns.y, turns.z};
          k.mean_spin = k.mean_spin + Double4(0.5) * wall_spin;
          k.relative_spin = k.relative_spin - wall_spin;
        }
        if constexpr (Model::has_rolling) {
          k.reduced_inertia = inertia_of(a);
          k.rolling_inertia = k.reduced_inertia + a.velocity.w * a.position.w * a.position.w;
        }
      }
      HistoryLane* const stored = numbers > 0 ? &contacts.history[c / lanes * numbers] : nullptr;
      const auto r = answer<ledger>(k, stored, ledger ? wall.w * counting(count) : Double4(1.0), energy);
      const auto force = wall.w * force_of(r, k.normal);
      Turn torque = zero_vector<Double4, Pack::turns>();
      if constexpr (Model::rotates) torque = -((wall.w * arm) * turning_of(r, k.normal));
      if constexpr (Model::has_rolling) {
        const Turn rolling = wall.w * r.torque;
        torque = torque + rolling;
        set_rows(&contacts.torque[c], count, torque_rows(rolling));
      }
      set_rows(&contacts.force[c], count, force_rows(force, zero_vector<Double4, Pack::turns>()));
      add_rows(particles.force.data(), i, count, force_rows(force, torque));
      if constexpr (dimension == 3 && Model::rotates) add_rows(particles.torque.data(), i, count, torque_rows(torque));
    }
  }

  typename Model::Parameters parameters_;
};

}  // namespace acopla::dem
