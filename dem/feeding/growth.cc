#include "dem/feeding/growth.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "dem/feeding/occupancy.h"

namespace acopla::dem {
namespace {

struct Pair {
  std::uint32_t first, second;
};

// Soft particles with unit springs. Lengths are in metres, forces are overlaps; the mass grows as the number of neighbours, r^(D−1), so
// that a large particle among small ones is no stiffer than they are.
class Relaxation {
 public:
  Relaxation(const Region& region, std::span<const double> radii, Random& random)
      : region_(region), radii_(radii.begin(), radii.end()), smallest_(*std::min_element(radii.begin(), radii.end())) {
    for (const double radius : radii_) mean_ += radius / static_cast<double>(radii_.size());
    for (std::size_t i = 0; i < radii_.size(); ++i) at_.push_back(region.random_point(random));
    sort_by_cell(2 * mean_);
    for (const double radius : radii_) {
      mass_.push_back(std::pow(std::max(1.0, radius / mean_), region.dimension() - 1));
    }
    velocity_.resize(at_.size());
    force_.resize(at_.size());
  }

  const std::vector<Vec3>& at() const { return at_; }
  int iterations() const { return iterations_; }
  // Thermal motion of the soft particles while they cool from `hot` to `cold` [springs' energy of an overlap of one mean radius],
  // with Maxwell's velocities drawn anew every 50 steps.
  void anneal(double scale, double hot, double cold, int steps, Random& random) {
    scale_ = scale;
    pairs_at_.clear();
    constexpr double step = 0.3;
    for (int k = 0; k < steps; ++k, ++iterations_) {
      if (k % 50 == 0) {
        const double temperature = hot * std::pow(cold / hot, static_cast<double>(k) / steps);
        for (std::size_t i = 0; i < at_.size(); ++i)
          for (int d = 0; d < region_.dimension(); ++d) velocity_[i][d] = mean_ * std::sqrt(temperature / mass_[i]) * random.normal();
      }
      update_pairs();
      sum_forces();
      for (std::size_t i = 0; i < at_.size(); ++i) {
        velocity_[i] += step / mass_[i] * force_[i];
        at_[i] += step * velocity_[i];
      }
    }
  }

  // Relaxes the particles at `scale` times their radii until none overlaps another or a wall by more than `tolerance` of
  // the sum of radii. False when they jam before.
  bool relax(double scale, double tolerance, int most) {
    scale_ = scale;
    pairs_at_.clear();
    std::fill(velocity_.begin(), velocity_.end(), Vec3::Zero());
    double step = 0.1, mixing = 0.1;
    int downhill = 0;
    for (int iteration = 0; iteration < most; ++iteration, ++iterations_) {
      update_pairs();
      const auto state = sum_forces();
      if (state.overlap <= tolerance) return true;
      // Jammed: the springs hold each other up.
      if (iteration % 50 == 49 && state.net < 1e-4 * state.spring) return false;
      double power = 0, speed = 0, pull = 0;
      for (std::size_t i = 0; i < at_.size(); ++i) {
        power += force_[i].dot(velocity_[i]);
        speed += velocity_[i].squaredNorm();
        pull += force_[i].squaredNorm() / (mass_[i] * mass_[i]);
      }
      if (power > 0) {
        if (++downhill > 5) {
          step = std::min(1.1 * step, 0.3);
          mixing *= 0.99;
        }
      } else {
        for (std::size_t i = 0; i < at_.size(); ++i) at_[i] -= 0.5 * step * velocity_[i];
        std::fill(velocity_.begin(), velocity_.end(), Vec3::Zero());
        step = std::max(0.5 * step, 0.02);
        mixing = 0.1;
        downhill = 0;
        speed = 0;
      }
      const double turn = pull > 0 ? mixing * std::sqrt(speed / pull) : 0;
      for (std::size_t i = 0; i < at_.size(); ++i) {
        const Vec3 acceleration = force_[i] / mass_[i];
        velocity_[i] = (1 - mixing) * (velocity_[i] + step * acceleration) + turn * acceleration;
        at_[i] += step * velocity_[i];
      }
    }
    return false;
  }

 private:
  struct State {
    double overlap = 0;  // largest, over the sum of radii
    double net = 0;      // root mean square of the particles' forces
    double spring = 0;   // root mean square of the springs'
  };

  // Neighbours in space become neighbours in memory.
  void sort_by_cell(double edge) {
    const Vec3 low = region_.bounds().low;
    std::vector<std::pair<std::array<double, 3>, Vec3>> order;
    for (const auto& at : at_) {
      const Vec3 cell = ((at - low) / edge).array().floor();
      order.push_back({{cell[2], cell[1], cell[0]}, at});
    }
    std::stable_sort(order.begin(), order.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    for (std::size_t i = 0; i < at_.size(); ++i) at_[i] = order[i].second;
  }

  void update_pairs() {
    const double skin = 0.5 * smallest_;
    if (!pairs_at_.empty()) {
      double moved = 0;
      for (std::size_t i = 0; i < at_.size(); ++i) moved = std::max(moved, (at_[i] - pairs_at_[i]).squaredNorm());
      if (4 * moved < skin * skin) return;
    }
    pairs_at_ = at_;
    pairs_.clear();
    Occupancy occupancy(region_.dimension(), scale_ * *std::max_element(radii_.begin(), radii_.end()));
    const auto count = static_cast<std::uint32_t>(at_.size());
    for (std::uint32_t i = 0; i < count; ++i) occupancy.add(at_[i], scale_ * radii_[i], i);
    for (std::uint32_t i = 0; i < count; ++i) {
      const double radius = scale_ * radii_[i];
      const int level = occupancy.level_of(radius);
      occupancy.for_each_near(
          at_[i], radius, skin,
          [&](const Occupancy::Entry& other) {
            const double reach = radius + other.radius + skin;
            // From the smaller of the two; between equals from the later.
            if ((occupancy.level_of(other.radius) < level || other.index < i) && (at_[i] - other.at).squaredNorm() < reach * reach)
              pairs_.push_back({i, other.index});
            return true;
          },
          level);
    }
  }

  State sum_forces() {
    State state;
    std::size_t springs = 0;
    std::fill(force_.begin(), force_.end(), Vec3::Zero());
    for (const auto& [i, j] : pairs_) {
      const Vec3 way = at_[i] - at_[j];
      const double reach = scale_ * (radii_[i] + radii_[j]), square = way.squaredNorm();
      if (square >= reach * reach) continue;
      const double distance = std::sqrt(square), overlap = reach - distance;
      // Two points in the same place part along x.
      const Vec3 push = distance > 0 ? Vec3(way * (overlap / distance)) : Vec3(overlap * Vec3::UnitX());
      force_[i] += push;
      force_[j] -= push;
      state.overlap = std::max(state.overlap, overlap / (radii_[i] + radii_[j]));
      state.spring += overlap * overlap;
      ++springs;
    }
    for (std::size_t i = 0; i < at_.size(); ++i) {
      for (const auto& face : region_.faces(at_[i])) {
        const double overlap = scale_ * radii_[i] - face.distance;
        if (overlap <= 0) continue;
        force_[i] += overlap * face.inward;
        state.overlap = std::max(state.overlap, overlap / radii_[i]);
        state.spring += overlap * overlap;
        ++springs;
      }
      state.net += force_[i].squaredNorm();
    }
    state.net = std::sqrt(state.net / static_cast<double>(at_.size()));
    state.spring = springs ? std::sqrt(state.spring / static_cast<double>(springs)) : 0;
    return state;
  }

  const Region& region_;
  std::vector<double> radii_, mass_;
  double smallest_, mean_ = 0, scale_ = 1;
  std::vector<Vec3> at_, velocity_, force_, pairs_at_;
  std::vector<Pair> pairs_;
  int iterations_ = 0;
};

}  // namespace

Packing grow_packing(const Region& region, std::span<const double> radii, Random& random) {
  Packing packing;
  if (radii.empty()) return packing;
  const int dimension = region.dimension();
  double solid = 0;
  for (const double radius : radii) solid += particle_volume(radius, dimension);
  const double target = solid / region.volume();
  const auto scale_for = [&](double share) { return std::pow(share, 1.0 / dimension); };  // of the target
  Relaxation relaxation(region, radii, random);
  // Coarse stages only spread the particles; the last one must end without overlap.
  for (const double share : {0.4, 0.6, 0.75, 0.85, 0.92, 0.97}) relaxation.relax(scale_for(share), 0.02, 300);
  const auto fits = [&](double scale, int most) {
    const bool done = relaxation.relax(scale * (1 + growth_margin), scale * growth_margin, most);
    if (done) {
      packing.at = relaxation.at();
      packing.solid_fraction = target * std::pow(scale, dimension);
    }
    return done;
  };
  constexpr int patience = 3000;
  if (!fits(1, patience)) {
    packing.jammed = true;
    // Equal particles jam as loosely as random starts can; those that have been hot at this fraction, a little more densely.
    const bool near = relaxation.relax(scale_for(0.93), growth_margin, patience);
    for (const int steps : {3000, 10000})
      if (near && packing.jammed) {
        relaxation.anneal(1, 1e-2, 1e-5, steps, random);
        packing.jammed = !fits(1, patience);
      }
    // What does fit, to less than 1 % of the target.
    double fit = 0, tight = 1;
    while (packing.jammed && tight - fit > (fit > 0 ? 0.008 : 1e-3)) {
      const double share = (fit + tight) / 2;
      (fits(scale_for(share), patience) ? fit : tight) = share;
    }
  }
  packing.iterations = relaxation.iterations();
  return packing;
}

}  // namespace acopla::dem
