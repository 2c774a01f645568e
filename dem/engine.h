// The moving part of the particles: neighbours, contacts and time stepping.
#pragma once

#include <memory>
#include <vector>

#include "dem/energy.h"
#include "dem/integration.h"
#include "dem/neighbours.h"
#include "dem/scene.h"
#include "dem/stability.h"
#include "dem/team.h"
#include "dem/touching_pairs.h"
#include "dem/wall/contacts.h"
#include "dem/wall/load.h"

namespace acopla::dem {

/// What a scene stores, for `acopla explain`.
struct EngineCosts {
  std::size_t bytes_per_particle = 0, bytes_per_contact = 0;
};

/// Steps the particles of a scene. The particles are sorted along a space-filling curve and cut into contiguous partitions, one a
/// thread (or as many as the case asks for: results depend on the number of partitions, not on that of threads). A step is
///   move the particles of each partition │ forces of each partition │ …
/// with nothing between threads but the end of each half: forces on another partition's particles are handed over in a fixed order.
class Engine {
 public:
  Engine(const Scene& scene, Particles particles, WallSet walls);

  /// Advances by `steps` steps of Δt. @throws std::runtime_error when a particle leaves the domain, moves too far in a
  /// step or is pushed through a wall, or the energy drifts; the message names the particle, the place and the time
  void advance(std::uint64_t steps, double step);
  /// The walls' load over the last advance().
  const WallLoad& wall_load() const { return load_; }
  WallSet& walls() { return walls_; }
  const WallSet& walls() const { return walls_; }
  const Particles& particles() const { return particles_; }
  /// Between advance() calls velocities and spins may be changed, but not positions.
  Particles& particles() { return particles_; }
  /// Adds particles between two advance() calls; they must not overlap others by much.
  void insert(const std::vector<NewParticle>& particles);
  /// Takes out all particles for which `leaves` says so. @return their mass [kg]
  double remove(const std::function<bool(std::size_t)>& leaves);
  double time() const { return time_; }
  /// Time and the energy ledger begin anew with the particles as they are.
  void restart_clock();

  /// Contacts at the last step, particle–particle and particle–wall.
  std::size_t contact_count() const;
  /// Δt over the stability limit of the contacts there are (StabilityEstimate::ratio), and who decides it.
  StepRatio step_ratio(double step) const { return stability(step).ratio(); }
  /// The same in parts: a bound that costs some steps, a limit that costs hundreds in a large bed.
  StabilityEstimate stability(double step) const;
  /// How the contacts hold each vertex of a wall that is sent, the same in all three components.
  struct Hold {
    std::vector<Vec3> stiffness, dashpot, mass;  ///< of the contacts [N/m], [N s/m], and of the particles that touch [kg]
  };
  Hold hold_on(std::size_t wall) const;
  /// Deepest overlap over the smaller radius.
  double worst_overlap() const;
  std::uint64_t rebuilds() const { return rebuilds_; }
  /// How often the pairs that touch were looked for in the list of neighbours.
  std::uint64_t refreshes() const { return refreshes_; }
  std::size_t listed_pairs() const;
  /// Pairs of the shorter list that are computed each step.
  std::size_t near_pairs() const;
  EngineCosts costs() const;

  /// Σ m v²/2 + I ω²/2 [J]
  double kinetic_energy() const;
  /// Σ m [kg]
  double mass() const;
  /// Σ m v [kg m/s]
  Vec3 momentum() const;
  bool keeps_ledger() const { return keeps_ledger_; }
  /// The energy balance. @pre keeps_ledger()
  Energy energy();

  /// Everything that decides the trajectory from here on, bit by bit: lists in their order, histories, partitions and all.
  template <class Archive>
  void state(Archive& archive) {
    archive("particles", particles_);
    archive("walls", walls_);
    archive("partitions", partitions_);
    archive("loads", loads_);
    archive("reference", reference_);
    archive("skin", skin_);
    archive("near_skin", near_skin_);
    archive("travel", travel_);
    archive("near_travel", near_travel_);
    archive("time", time_);
    archive("started", started_);
    archive("outdated", outdated_);
    archive("rebuilds", rebuilds_);
    archive("refreshes", refreshes_);
    archive("steps_since_rebuild", steps_since_rebuild_);
    archive("steps_since_refresh", steps_since_refresh_);
    archive("ledger", ledger_);
    archive("smallest", smallest_);
    archive("largest", largest_);
    archive("one_material", one_material_);
    if constexpr (Archive::reading) link_exports();
  }

 private:
  struct Partition {
    std::uint32_t first = 0, last = 0;
    PairList rows;
    TouchingPairs pairs;
    WallContactList walls;
    // Forces on own particles that other partitions computed: where they lie, and on whom. In the order of the partitions.
    struct Import {
      std::uint32_t from, place, particle;
    };
    std::vector<Import> imports;
    ContactEnergy<double> energy;  // of this step
    double damping_power = 0;
    Travel travel;
    bool complete = false;  // the forces hold all that acts

    template <class Archive>
    void state(Archive& archive) {
      archive("first", first);
      archive("last", last);
      archive("rows", rows.start);
      archive("second", rows.second);
      archive("pairs", pairs);
      archive("walls", walls);
      archive("complete", complete);
    }
  };

  void start();
  void set_sizes();
  void move(double kick, double step);
  void complete(double kick);
  void complete_forces(Partition& partition);
  void take_imports(Partition& partition);
  void keep_lists(double step);
  void evaluate(double step);
  void rebuild(const std::vector<std::uint32_t>* stay = nullptr);
  void refresh(const SavedPairs* saved);
  void sort_particles(const std::vector<std::uint32_t>& order);
  void link_exports();
  double farthest() const;
  double potential_energy() const;
  template <class Action>
  void for_each_pair(Action&& action) const {  // action(i, j, overlap) for those that touch
    for (const auto& partition : partitions_)
      partition.pairs.for_each([&](std::uint32_t i, std::uint32_t j) {
        const Record &a = particles_.position[i], &b = particles_.position[j];
        const double overlap = a.w + b.w - (a.vector() - b.vector()).norm();
        if (overlap > 0) action(i, j, overlap);
      });
  }
  void stop_at_fastest(double step) const;
  void check_domain() const;
  void check_first_overlaps() const;
  void check_energy(double step);

  Vec3 gravity_;
  Damping damping_;
  KernelTable kernels_;
  std::vector<double> densities_;  // by material
  Particles particles_;
  WallSet walls_;
  geometry::Box domain_;
  bool keeps_ledger_ = false, allow_unstable_ = false;
  double drift_limit_ = 0;
  double smallest_ = 0, largest_ = 0, time_ = 0;
  bool one_material_ = true;  // of the particles
  bool started_ = false;
  bool outdated_ = true;  // particles came or went: the lists are void

  HierarchicalGrid grid_;
  std::vector<Partition> partitions_;
  Team team_;
  std::vector<Record> reference_;  // positions at the last rebuild
  double skin_ = 0, near_skin_ = 0;            // of the list of neighbours and of the pairs that touch [m]
  double travel_ = 0, near_travel_ = 0;        // bounds of what any particle moved since each was made [m]
  std::uint64_t rebuilds_ = 0, refreshes_ = 0, steps_since_rebuild_ = 0, steps_since_refresh_ = 0;
  SavedPairs saved_pairs_;
  std::vector<std::uint32_t> place_, order_;
  SavedWallHistories saved_walls_;
  WallLoadSum loads_;
  EnergyLedger ledger_;
  WallLoad load_;
};

/// The engine of a scene.
std::unique_ptr<Engine> make_engine(const Scene& scene, Particles particles);
/// The same with walls already prepared.
std::unique_ptr<Engine> make_engine(const Scene& scene, Particles particles, WallSet walls);

}  // namespace acopla::dem
