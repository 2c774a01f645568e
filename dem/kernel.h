// The contact forces of one pair of materials: what the engine sees of the laws.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "dem/contact/model.h"
#include "dem/particles.h"
#include "dem/simd.h"

namespace acopla::dem {

/// Storage of histories: packs of `lanes` contacts, each pack one row a stored number.
struct alignas(8 * lanes) HistoryLane {
  double value[lanes];
};

/// Pairs of particles that touch or nearly touch, of one pair of materials, i < j, and some that did. The arrays are padded to whole
/// packs; spare lanes repeat the last pair and are thrown away.
struct PairContacts {
  std::vector<std::uint32_t> i, j;
  std::vector<std::uint32_t> slot;      ///< place in the list of neighbours
  std::vector<HistoryLane> history;     ///< [pack · history_size + number]
  std::size_t size = 0;                 ///< pairs, without spare lanes
  /// Where j is another thread's particle: the force on it goes to exports[first_export + pair], not to the particle.
  bool exports = false;
  std::size_t first_export = 0;

  template <class Archive>
  void state(Archive& archive) {
    archive("i", i);
    archive("j", j);
    archive("slot", slot);
    archive("history", history);
    archive("size", size);
    archive("exports", exports);
    archive("first_export", first_export);
  }
};

/// Contacts of one partition's particles of one material with walls of one material. Filled by
/// the walls' geometry before the kernel and read by it after; padded to whole packs like PairContacts.
struct WallContacts {
  std::vector<std::uint32_t> particle;
  std::vector<Record> normal;     ///< unit, from the wall to the particle; w: overlap [m]
  std::vector<Record> velocity;   ///< of the wall at the contact point [m/s]; w: weight in (0, 1] of the contact (crease sharing)
  std::vector<Record> wall_spin;  ///< angular velocity of the wall [rad/s]; empty where all walls of the scene stand or translate
  std::vector<double> curvature;  ///< 1/radius of the wall's surface [1/m]; empty where no wall of the scene is glued particles
  std::vector<HistoryLane> history;
  std::size_t size = 0;
  std::vector<Record> force;   ///< out: on the particle, weighted [N]
  std::vector<Record> torque;  ///< out: rolling torque on the particle, weighted [N m]; filled where the model rolls
};

/// Forces on particles of other partitions.
struct Exports {
  std::vector<Record> force, torque;
};

/// Stiffness and dashpots of one contact, for estimates of the stable step.
struct ContactStiffness {
  double normal = 0, shear = 0, rolling = 0;                   ///< [N/m], [N/m], [N m/rad]
  double normal_dashpot = 0, shear_dashpot = 0, rolling_dashpot = 0;  ///< [N s/m], [N s/m], [N m s/rad]
  double twisting = 1;    ///< springs and dashpots about the normal, in three dimensions, over those of rolling
  double spin_share = 0;  ///< a torque beside them takes at most this share of the relative spin in a step, whatever the step
};

/// A contact model with the parameters of one pair of materials. Stateless: histories live in the contacts.
class Kernel {
 public:
  virtual ~Kernel() = default;
  /// Adds the forces and torques of all pairs to the particles (or to `exports`), and carries the histories on.
  /// @param energy  where not null, energies and powers are added to it
  virtual void pairs(PairContacts& contacts, Particles& particles, Exports& exports, double step, ContactEnergy<double>* energy) const = 0;
  /// The same for walls; also fills contacts.force and contacts.torque.
  virtual void walls(WallContacts& contacts, Particles& particles, double step, ContactEnergy<double>* energy) const = 0;
  /// Doubles a contact stores.
  virtual std::size_t history_size() const = 0;
  /// Factor of each stored number when i and j change names.
  virtual std::span<const double> swap_signs() const = 0;
  virtual ContactStiffness stiffness(double overlap, double reduced_radius, double reduced_mass, double rolling_inertia) const = 0;
  virtual bool rotates() const = 0;
  virtual bool rolls() const = 0;
};

}  // namespace acopla::dem
