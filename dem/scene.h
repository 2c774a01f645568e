// What a case asks of the particles, and nothing else: the set of laws, materials, walls and insertions it uses. What is
// not in it is not computed, not allocated and not sent; this is where that is decided.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "dem/contact/pair_properties.h"
#include "dem/damping.h"
#include "dem/feeding/fill.h"
#include "dem/feeding/inlet.h"
#include "dem/wall/wall_set.h"
#include "io/case_table.h"

namespace acopla::dem {

class Laws;

struct Material {
  std::string name;
  double density = 0;        ///< [kg/m³]
  double shear_modulus = 0;  ///< G [Pa]; 0 where no law needs it
  double poisson = 0;
  double young() const { return 2 * shear_modulus * (1 + poisson); }
};

/// Particles from the checkpoint of another run, in place of fillings.
struct StartFrom {
  /// Of one material.
  struct Content {
    std::uint8_t material = 0;
    std::size_t count = 0;
    double smallest_radius = 0, largest_radius = 0;  ///< [m]
  };
  std::string file;      ///< a checkpoint
  std::vector<Content> contents;
  bool whole = false;    ///< its whole state, histories and all: the same scene goes on bit by bit; else the particles alone
  io::Location where;
};

/// Before time begins: the particles come to rest while all walls stand.
struct Settling {
  double kinetic_energy = 0;  ///< per particle over its weight times its radius: at rest below this
  double limit = 0;           ///< [s]; longer than this is an error
  io::Location where;
};

struct Scene {
  std::string name;              ///< of the participant
  int dimension = 3;             ///< 2: discs of unit depth; 3: spheres
  Vec3 gravity = Vec3::Zero();   ///< [m/s²]
  std::shared_ptr<const Laws> laws;   ///< what the case may name; open while its kernels run
  std::vector<Material> materials;
  std::vector<PairProperties> pairs;  ///< [i · materials + j], symmetric
  std::vector<Wall> walls;
  std::vector<Filling> fillings;
  std::vector<Inlet> inlets;
  std::vector<Outlet> outlets;
  std::optional<StartFrom> start_from;
  std::optional<Settling> settling;
  Damping damping;
  std::uint64_t seed = 1;
  double step_fraction = 0.2;
  std::optional<double> step;  ///< fixed by the case [s]
  bool allow_unstable_step = false;
  unsigned threads = 1;
  unsigned partitions = 1;     ///< results depend on this and not on `threads`
  bool keeps_ledger = false;
  double drift_limit = 0.05;   ///< of the energy ledger, relative
  std::optional<geometry::Box> domain;
  double output_every = 0;     ///< [s]; 0: only the end
  bool write_particles = true;
  bool write_checkpoint = false;  ///< at the end, and with every picture

  const PairProperties& pair(std::size_t i, std::size_t j) const { return pairs[i * materials.size() + j]; }
  /// At the start; inlets come on top.
  std::size_t particle_count() const;
  FillSettings fill_settings() const { return {dimension, gravity, seed, {}}; }
  /// Of a material's particles, those of inlets included; 0 where it has none [m].
  double smallest_radius(std::size_t material) const;
  double largest_radius() const;
  /// Materials that particles are made of.
  std::vector<std::uint8_t> particle_materials() const;
  /// Boxes around everything that particles are put into.
  std::vector<geometry::Box> regions() const;
  /// The laws that are used, each set once.
  std::vector<LawSet> law_sets() const;
  /// Some law turns the particles.
  bool rotates() const;
  ParticleKind kind() const { return {dimension, rotates()}; }
};

/// Reads and checks the participant's table; reads the wall meshes it names. @throws io::UserError
Scene read_scene(const io::Table& root, const std::string& name);

}  // namespace acopla::dem
