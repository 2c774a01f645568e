// The contacts of one partition's particles with the walls: candidates, histories, forces.
//
// Most particles near a wall are over the inside of a plane or of a facet, far from every edge. Those are found when the list is made
// and cost one dot product a step ("lone" candidates), as do glued balls. The others go through the whole set of rules of touching.h.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "dem/kernel.h"
#include "dem/wall/load.h"
#include "dem/wall/touching.h"
#include "dem/wall/wall_set.h"

namespace acopla::dem {

/// The contact models of a scene, [particle's material · materials + wall's material].
struct KernelTable {
  const Kernel* const* kernels = nullptr;
  std::size_t materials = 0;
  const Kernel& of(std::size_t i, std::size_t j) const { return *kernels[i * materials + j]; }
};

/// Histories by the name of their particle, while particles are sorted anew.
struct SavedWallHistories {
  struct Contact {
    std::uint32_t id, element;
    Vec3 point, normal;
    std::uint32_t first, size;  ///< of `numbers`
  };
  std::vector<Contact> contacts;
  std::vector<double> numbers;

  void clear();
  /// All of another partition, behind these.
  void append(const SavedWallHistories& other);
  /// By id, before restore().
  void sort();
};

class WallContactList {
 public:
  /// Lists the elements near the particles first … last−1: within radius + skin/2, so that the list holds while particles and walls
  /// together have moved by no more than skin/2. Contacts and histories are forgotten.
  void find(const KernelTable& kernels, const WallSet& walls, const Particles& particles, std::uint32_t first, std::uint32_t last, double skin);
  /// Appends the present histories. Before the particles are sorted.
  void collect(const Particles& particles, SavedWallHistories& saved) const;
  /// After find(): the histories of this partition's particles. `saved` is sorted.
  void restore(const WallSet& walls, const Particles& particles, const SavedWallHistories& saved);

  /// Finds the present contacts of the listed particles and their kinematics, and moves the histories where contacts have changed.
  /// @throws std::runtime_error when a particle is pushed through a wall
  void update(const WallSet& walls, const Particles& particles, double time);
  /// Lets the kernels answer, and adds forces to the particles and to the walls.
  void evaluate(const KernelTable& kernels, const WallSet& walls, Particles& particles, double step, WallForces& forces,
                ContactEnergy<double>* energy);

  /// Of the last evaluation, one a wall.
  std::span<const WallResultant> resultants() const { return resultants_; }
  std::size_t contact_count() const;
  std::size_t candidate_count() const;
  /// Calls action(particle, particle_material, wall_material, overlap, normal, curvature) for every present contact.
  template <class Action>
  void for_each_contact(Action&& action) const {
    for (const auto& group : groups_)
      for (std::size_t c = 0; c < group.contacts.size; ++c)
        action(group.contacts.particle[c], group.particle_material, group.wall_material, group.contacts.normal[c].w,
               group.contacts.normal[c].vector(), group.contacts.curvature.empty() ? 0.0 : group.contacts.curvature[c]);
  }

  template <class Archive>
  void state(Archive& archive) {
    archive("first", first_);
    archive("near", near_);
    archive("start", start_);
    archive("elements", elements_);
    std::size_t count = groups_.size();
    archive("groups", count);
    groups_.resize(count);
    for (auto& group : groups_) group.state(archive);
    archive("resultants", resultants_);
  }

 private:
  // A particle over the inside of a plane or facet.
  struct Lone {
    Record plane;  // normal on the particle's side, now; w: normal · x on it
    std::uint32_t particle, element;
    double side;  // of a facet: +1 or −1
  };
  struct Near {
    std::uint32_t particle, element;
  };
  // What a contact by the rules leaves for the next step and for the loads.
  struct Detail {
    Vec3 point, normal;
    double distance;
    std::array<double, 3> weights;
    std::uint32_t element;
  };
  // Contacts of one material with walls of one material: first the lone ones, then balls, then those by the rules, each ascending.
  struct Group {
    std::uint8_t particle_material = 0, wall_material = 0;
    std::uint32_t numbers = 0;  // a history has
    std::uint8_t moves = 0, turns = 0, curved = 0;
    std::vector<Lone> lone;
    std::vector<Near> balls;
    std::uint32_t ruled = 0;  // candidates by the rules
    WallContacts contacts;
    std::vector<std::uint32_t> key, key_before;        // candidate: lone, then ball, then place in elements_
    std::vector<Detail> detail, detail_before;         // of contacts by the rules
    std::uint32_t first_detail = 0, first_detail_before = 0;
    std::size_t size_before = 0;

    template <class Archive>
    void state(Archive& archive) {
      archive("particle_material", particle_material);
      archive("wall_material", wall_material);
      archive("numbers", numbers);
      archive("moves", moves);
      archive("turns", turns);
      archive("curved", curved);
      archive("lone", lone);
      archive("balls", balls);
      archive("ruled", ruled);
      archive("particle", contacts.particle);
      archive("normal", contacts.normal);
      archive("velocity", contacts.velocity);
      archive("wall_spin", contacts.wall_spin);
      archive("curvature", contacts.curvature);
      archive("history", contacts.history);
      archive("size", contacts.size);
      archive("key", key);
      archive("detail", detail);
      archive("first_detail", first_detail);
    }
  };

  std::uint32_t first_ = 0;
  std::vector<std::uint32_t> near_, start_, elements_;  // particles that need the rules, and elements of each (CSR)
  std::vector<Group> groups_;
  std::vector<WallResultant> resultants_;
};

}  // namespace acopla::dem
