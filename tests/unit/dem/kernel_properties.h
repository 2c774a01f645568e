// What the kernel of any combination of laws must do, asked through the interface that the engine uses: for the built-in laws, and for
// those of a library.
#pragma once

#include <gtest/gtest.h>

#include <random>

#include "dem/laws.h"
#include "tests/unit/dem/law_paths.h"

namespace acopla::dem::test {

/// Random pairs of bodies in contact or nearly, each body in one pair only.
struct PairBatch {
  int dimension;
  Particles particles;
  PairContacts contacts;
  Exports exports;

  PairBatch(const Kernel& kernel, int dim, std::size_t pairs, unsigned seed, bool touching = true) : dimension(dim) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> uniform;
    const auto any = [&] { return Vec3(normal(random), normal(random), dimension == 3 ? normal(random) : 0); };
    const auto any_spin = [&] { return dimension == 3 ? any() : Vec3(0, 0, normal(random)); };
    particles.kind = {dimension, kernel.rotates()};
    for (std::size_t n = 0; n < pairs; ++n) {
      const Vec3 at = 0.1 * any();
      const double a = 0.005 * (1 + uniform(random)), b = 0.005 * (1 + uniform(random));
      const double overlap = touching ? 1e-4 * uniform(random) : -1e-4 * uniform(random);
      particles.add(at, a, 2500, 0, 0.1 * any(), 20 * any_spin());
      particles.add(at + (a + b - overlap) * any().normalized(), b, 2500, 0, 0.1 * any(), 20 * any_spin());
      contacts.i.push_back(static_cast<std::uint32_t>(2 * n));
      contacts.j.push_back(static_cast<std::uint32_t>(2 * n + 1));
    }
    finish(kernel);
  }
  /// After i and j are set: spare lanes and room for histories and forces.
  void finish(const Kernel& kernel) {
    contacts.size = contacts.i.size();
    while (contacts.i.size() % lanes) {
      contacts.i.push_back(contacts.i.back());
      contacts.j.push_back(contacts.j.back());
    }
    contacts.history.assign(contacts.i.size() / lanes * kernel.history_size(), HistoryLane{});
    clear();
  }
  void clear() {
    for (auto* records : {&particles.force, &particles.torque}) records->assign(records->size(), Record{});
    if (dimension == 2)
      for (auto& record : particles.force) record = {};
  }
  Vec3 force(std::size_t i) const { return dimension == 3 ? particles.force[i].vector() : Vec3(particles.force[i].x, particles.force[i].y, 0); }
  Vec3 torque(std::size_t i) const {
    if (dimension == 2) return {0, 0, particles.force[i].z};
    return particles.torque.empty() ? Vec3::Zero() : particles.torque[i].vector();
  }
  double& history(const Kernel& kernel, std::size_t pair, std::size_t number) {
    return contacts.history[pair / lanes * kernel.history_size() + number].value[pair % lanes];
  }
  /// Steps the bodies along with their velocities, without letting the forces act.
  void step(const Kernel& kernel, double seconds, ContactEnergy<double>* energy = nullptr) {
    for (std::size_t i = 0; i < particles.size(); ++i)
      particles.position[i].set(particles.position[i].vector() + seconds * particles.velocity_of(i));
    clear();
    kernel.pairs(contacts, particles, exports, seconds, energy);
  }
};

inline constexpr double kernel_step = 1e-5;  ///< [s]

/// Forces of a contact are opposite and leave no moment: exactly opposite forces; the moment to the round-off of the arms.
inline void expect_action_and_reaction(const Kernel& kernel, int dimension) {
  PairBatch batch(kernel, dimension, 37, 1);
  for (int n = 0; n < 10; ++n) batch.step(kernel, kernel_step);
  double largest = 0;
  for (std::size_t i = 0; i < batch.particles.size(); i += 2) {
    EXPECT_EQ((batch.force(i) + batch.force(i + 1)).norm(), 0);
    const Vec3 between = batch.particles.position[i].vector() - batch.particles.position[i + 1].vector();
    EXPECT_LE((between.cross(batch.force(i)) + batch.torque(i) + batch.torque(i + 1)).norm(), 1e-14 * batch.force(i).norm() * between.norm());
    largest = std::max(largest, batch.force(i).norm());
  }
  EXPECT_GT(largest, 0);
}

/// Which body is called i does not matter, before and after the names are exchanged: only signs change.
inline void expect_names_do_not_matter(const Kernel& kernel, int dimension) {
  PairBatch batch(kernel, dimension, 37, 2), renamed = batch;
  for (int n = 0; n < 20; ++n) {
    if (n == 10) {
      std::swap(renamed.contacts.i, renamed.contacts.j);
      for (std::size_t pair = 0; pair < renamed.contacts.size; ++pair)
        for (std::size_t m = 0; m < kernel.history_size(); ++m) renamed.history(kernel, pair, m) *= kernel.swap_signs()[m];
    }
    batch.step(kernel, kernel_step);
    renamed.step(kernel, kernel_step);
  }
  for (std::size_t i = 0; i < batch.particles.size(); ++i) {
    EXPECT_LE((batch.force(i) - renamed.force(i)).norm(), 1e-14 * batch.force(i).norm());
    EXPECT_LE((batch.torque(i) - renamed.torque(i)).norm(), 1e-13 * 0.01 * batch.force(i).norm());
  }
}

/// A pair's force does not depend on the pairs beside it in a pack: the same bits.
inline void expect_lanes_do_not_meet(const Kernel& kernel, int dimension) {
  PairBatch batch(kernel, dimension, 2 * lanes + 3, 3);
  std::vector<PairBatch> single;
  for (std::size_t pair = 0; pair < batch.contacts.size; ++pair) {
    single.push_back(batch);
    single.back().contacts.i = {batch.contacts.i[pair]};
    single.back().contacts.j = {batch.contacts.j[pair]};
    single.back().finish(kernel);
  }
  for (int n = 0; n < 10; ++n) {
    batch.step(kernel, kernel_step);
    for (auto& one : single) one.step(kernel, kernel_step);
  }
  for (std::size_t pair = 0; pair < batch.contacts.size; ++pair)
    for (const std::size_t i : {2 * pair, 2 * pair + 1}) {
      EXPECT_EQ((batch.force(i) - single[pair].force(i)).norm(), 0);
      EXPECT_EQ((batch.torque(i) - single[pair].torque(i)).norm(), 0);
    }
}

/// Lanes that do not touch: no force, no torque, no energy, and whatever was stored is forgotten.
inline void expect_silence_without_contact(const Kernel& kernel, int dimension) {
  PairBatch batch(kernel, dimension, 37, 4, false);
  for (auto& lane : batch.contacts.history)
    for (double& value : lane.value) value = 1e-3;
  batch.clear();
  ContactEnergy<double> energy;
  kernel.pairs(batch.contacts, batch.particles, batch.exports, kernel_step, &energy);
  for (std::size_t i = 0; i < batch.particles.size(); ++i) {
    EXPECT_EQ(batch.force(i).norm(), 0);
    EXPECT_EQ(batch.torque(i).norm(), 0);
  }
  for (const auto& lane : batch.contacts.history)
    for (const double value : lane.value) EXPECT_EQ(value, 0);
  EXPECT_EQ(energy.normal, 0);
  EXPECT_EQ(energy.normal_dashpot, 0);
}

/// Forces on another partition's particles go to the exports and nowhere else: the same bits.
inline void expect_exports_are_the_forces_on_j(const Kernel& kernel, int dimension) {
  PairBatch batch(kernel, dimension, 37, 5), exporting = batch;
  exporting.contacts.exports = true;
  exporting.exports.force.assign(exporting.contacts.i.size(), Record{});
  exporting.exports.torque.assign(exporting.contacts.i.size(), Record{});
  batch.step(kernel, kernel_step);
  exporting.step(kernel, kernel_step);
  for (std::size_t pair = 0; pair < batch.contacts.size; ++pair) {
    const std::size_t i = 2 * pair, j = i + 1;
    EXPECT_EQ((batch.force(i) - exporting.force(i)).norm(), 0);
    EXPECT_EQ(exporting.force(j).norm(), 0);
    const auto& sent = exporting.exports.force[pair];
    EXPECT_EQ((batch.force(j) - (dimension == 3 ? sent.vector() : Vec3(sent.x, sent.y, 0))).norm(), 0);
  }
}

/// A wall is a body of another mass and size: the contact of a particle with a wall of curvature 1/r that moves like the surface of a
/// sphere of radius r and of enormous mass is the contact with that sphere. The arm of a wall's force ends at the wall, that of a sphere's
/// at the middle of the overlap, so the wall is moved by what the difference slips.
inline void expect_walls_to_be_bodies(const Kernel& kernel, int dimension) {
  PairBatch batch(kernel, dimension, 37, 6);
  auto& p = batch.particles;
  for (std::size_t j = 1; j < p.size(); j += 2) {
    p.velocity[j].w *= 1e18;
    if (!p.spin.empty()) p.spin[j].w *= 1e18;
    p.set_spin(j, Vec3::Zero());
  }
  auto wall_particles = p;
  WallContacts walls;
  walls.particle.assign(batch.contacts.i.begin(), batch.contacts.i.end());
  const auto padded = walls.particle.size();
  walls.size = batch.contacts.size;
  walls.normal.resize(padded);
  walls.velocity.resize(padded);
  walls.curvature.resize(padded);
  walls.history.assign(batch.contacts.history.size(), HistoryLane{});
  for (int n = 0; n < 10; ++n) {
    batch.step(kernel, kernel_step);
    for (std::size_t c = 0; c < padded; ++c) {
      const std::size_t i = batch.contacts.i[c], j = batch.contacts.j[c];
      const Vec3 between = p.position[i].vector() - p.position[j].vector(), normal = between.normalized();
      const double overlap = p.position[i].w + p.position[j].w - between.norm();
      walls.normal[c].set(normal);
      walls.normal[c].w = overlap;
      walls.velocity[c].set(p.velocity_of(j) + 0.5 * overlap * p.spin_of(i).cross(normal));
      walls.velocity[c].w = 1;
      walls.curvature[c] = 1 / p.position[j].w;
    }
    for (auto* records : {&wall_particles.force, &wall_particles.torque}) records->assign(records->size(), Record{});
    kernel.walls(walls, wall_particles, kernel_step, nullptr);
  }
  double force = 0;  // round-off is that of overlaps of 1e-4 m between places at 0.1 m
  for (std::size_t i = 0; i < p.size(); ++i) force = std::max(force, batch.force(i).norm());
  for (std::size_t c = 0; c < walls.size; ++c) {
    const std::size_t i = walls.particle[c];
    const Vec3 on_wall = dimension == 3 ? walls.force[c].vector() : Vec3(walls.force[c].x, walls.force[c].y, 0);
    EXPECT_LE((on_wall - batch.force(i)).norm(), 1e-12 * force);
    if (!kernel.rolls()) continue;
    const Vec3 normal = walls.normal[c].vector(), arm = -(p.position[i].w - 0.5 * walls.normal[c].w) * normal;
    const Vec3 rolling = batch.torque(i) - arm.cross(batch.force(i));
    const Vec3 told = dimension == 3 ? walls.torque[c].vector() : Vec3(0, 0, walls.torque[c].z);
    EXPECT_LE((told - rolling).norm(), 1e-12 * force * p.position[i].w);
  }
}

/// The energy ledger listens and does not act. Compiled apart, with other fused operations: round-off.
inline void expect_the_ledger_not_to_act(const Kernel& kernel, int dimension) {
  PairBatch batch(kernel, dimension, 37, 7), counted = batch;
  ContactEnergy<double> energy;
  for (int n = 0; n < 10; ++n) {
    batch.step(kernel, kernel_step);
    counted.step(kernel, kernel_step, &energy);
  }
  for (std::size_t i = 0; i < batch.particles.size(); ++i) EXPECT_LE((batch.force(i) - counted.force(i)).norm(), 1e-13 * batch.force(i).norm());
  EXPECT_GT(energy.normal, 0);
}

inline void expect_kernel_properties(const Kernel& kernel, int dimension) {
  expect_action_and_reaction(kernel, dimension);
  expect_names_do_not_matter(kernel, dimension);
  expect_lanes_do_not_meet(kernel, dimension);
  expect_silence_without_contact(kernel, dimension);
  expect_exports_are_the_forces_on_j(kernel, dimension);
  expect_walls_to_be_bodies(kernel, dimension);
  expect_the_ledger_not_to_act(kernel, dimension);
}

}  // namespace acopla::dem::test
