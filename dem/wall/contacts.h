// The contacts of one partition's particles with the walls: candidates, histories, forces.
//
// Most particles near a wall are over the inside of a plane or of a facet, far from every edge. Those are found when the list is made
// and cost one dot product a step ("lone" candidates), as do glued balls. The others go through the whole set of rules of touching.h.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "dem/kernel_table.h"
#include "dem/wall/load.h"
#include "dem/wall/touching.h"
#include "dem/wall/wall_set.h"

namespace acopla::dem {

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
  /// Adds the stiffness [N/m] and the dashpot [N s/m] of every present contact, the larger of normal and tangential, to the vertices of
  /// walls that are sent, in all three components, and the mass of the particles that touch [kg].
  void add_stiffness(const KernelTable& kernels, const WallSet& walls, const Particles& particles, WallForces& stiffness, WallForces& dashpot, WallForces& mass) const;
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
    archive("near", near_);
    archive("start", start_);
    archive("elements", elements_);
    archive("place", place_);
    archive("materials", materials_);
    archive("groups", groups_);
    archive("resultants", resultants_);
  }

 private:
  struct Near {
    std::uint32_t particle, element;
  };
  struct Run {
    std::uint32_t wall, end;
  };
  // What a contact by the rules leaves for the next step and for the loads.
  struct Detail {
    Record point, normal;
    std::array<double, 3> weights;
    std::uint32_t element, near;  // near: place in near_
  };
  // Contacts of one material with walls of one material: first the lone ones, then balls, then those by the rules. Their keys, which
  // say what is the same contact as in the last step, ascend: place in `lone`, then in `balls`, then in elements_.
  struct Group {
    std::uint8_t particle_material = 0, wall_material = 0;
    bool moves = false, turns = false, curved = false;  // some wall of its candidates
    std::size_t numbers = 0;                            // a history has
    std::vector<Near> lone;     // particles over the inside of a plane or facet
    std::vector<Record> flats;  // of each: normal on the particle's side, and normal · x on it; in body axes
    std::vector<Run> runs;      // of lone candidates, by wall
    std::vector<Near> balls;
    std::size_t ruled = 0;  // candidates by the rules
    WallContacts contacts;
    std::vector<std::uint32_t> key;
    std::vector<Detail> detail;    // of contacts by the rules
    std::size_t first_ruled = 0;   // contact
    // Of the last step, while the present one is found.
    std::vector<std::uint32_t> key_before;
    std::vector<Detail> detail_before;
    std::vector<HistoryLane> history_before;
    std::size_t size_before = 0, first_ruled_before = 0;

    std::size_t capacity() const { return lone.size() + balls.size() + ruled; }
    std::uint32_t first_ruled_key() const { return static_cast<std::uint32_t>(lone.size() + balls.size()); }

    template <class Archive>
    void state(Archive& archive) {
      archive("particle_material", particle_material);
      archive("wall_material", wall_material);
      archive("moves", moves);
      archive("turns", turns);
      archive("curved", curved);
      archive("numbers", numbers);
      archive("lone", lone);
      archive("flats", flats);
      archive("runs", runs);
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
      archive("first_ruled", first_ruled);
      key_before.resize(key.size());
      detail_before.resize(detail.size());
      history_before.resize(contacts.history.size());
    }
  };

  Group& group_of(const KernelTable& kernels, const WallSet& walls, std::uint8_t particle_material, std::uint8_t wall_material);
  bool find_lone(const WallSet& walls, const Record& position, double travel, std::span<const std::uint32_t> elements);
  static void sort_by_wall(const WallSet& walls, Group& group);
  static void start_step(Group& group);
  static void touch_lone(Group& group, const WallSet& walls, const Particles& particles, double time);
  static void stop_lone(const Group& group, const WallSet& walls, const Particles& particles, double time);
  static void touch_balls(Group& group, const WallSet& walls, const Particles& particles, double time);
  void touch_by_rules(const WallSet& walls, const Particles& particles, double time);
  void add_by_rules(const WallSet& walls, std::uint8_t particle_material, std::uint32_t particle, std::uint32_t near, const NearestPoint& contact,
                    double overlap, double weight);
  void finish_step(Group& group, const WallSet& walls, const Particles& particles);
  void move_histories(Group& group, const WallSet& walls, const Particles& particles);
  void inherit(Group& group, const WallSet& walls, double radius, std::size_t first, std::size_t last, std::size_t first_before,
               std::size_t last_before);
  std::uint32_t element_of(const Group& group, std::size_t contact) const;
  void load(const Group& group, bool rolls, const WallSet& walls, const Particles& particles, WallForces& forces);
  static void spread(const Group& group, std::size_t contact, std::uint32_t element, const WallSet& walls, const Vec3& point, const Vec3& force,
                     const Vec3& couple, WallForces& forces);

  std::vector<std::uint32_t> near_, start_, elements_;  // particles that need the rules, and elements of each (CSR)
  std::vector<std::uint16_t> place_;                    // of groups, by materials
  std::size_t materials_ = 0;
  std::vector<Group> groups_;
  std::vector<WallResultant> resultants_;

  // Work space.
  std::vector<std::uint32_t> found_elements_, flats_;
  std::vector<NearestPoint> found_;
  std::vector<double> weights_;
  std::vector<std::size_t> origin_;
  std::vector<bool> used_;
};

}  // namespace acopla::dem
