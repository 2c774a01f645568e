// What a case asks of the particles, and nothing else: the set of laws, materials, walls and insertions it uses. What is
// not in it is not computed, not allocated and not sent; this is where that is decided.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "dem/contact/pair_properties.h"
#include "dem/wall/wall_set.h"
#include "io/case_table.h"

namespace acopla::dem {

struct Material {
  std::string name;
  double density = 0;        ///< [kg/m³]
  double shear_modulus = 0;  ///< G [Pa]; 0 where no law needs it
  double poisson = 0;
  double young() const { return 2 * shear_modulus * (1 + poisson); }
};

/// Spheres of one size, placed at random without overlap.
struct Insertion {
  std::uint8_t material = 0;
  double radius = 0;  ///< [m]
  std::size_t count = 0;
  Vec3 low = Vec3::Zero(), high = Vec3::Zero();  ///< whole spheres inside this box [m]
  Vec3 velocity = Vec3::Zero();                  ///< [m/s]
  io::Location where;                            ///< in the case, for the message when there is no room
};

/// Names of the laws of a scene; one set for all its pairs of materials.
struct LawSet {
  std::string normal, tangential = "none", rolling = "none";
  bool operator==(const LawSet&) const = default;
  std::string text() const { return normal + " + " + tangential + " + " + rolling; }
};

struct Scene {
  std::string name;              ///< of the participant
  Vec3 gravity = Vec3::Zero();   ///< [m/s²]
  LawSet laws;
  std::vector<Material> materials;
  std::vector<PairProperties> pairs;  ///< [i · materials + j], symmetric
  std::vector<Wall> walls;
  std::vector<Insertion> insertions;
  std::uint64_t seed = 1;
  double step_fraction = 0.2;
  std::optional<double> step;  ///< fixed by the case [s]
  bool allow_unstable_step = false;
  std::optional<geometry::Box> domain;
  double output_every = 0;     ///< [s]; 0: only the end
  bool write_particles = true;

  const PairProperties& pair(std::size_t i, std::size_t j) const { return pairs[i * materials.size() + j]; }
  std::size_t particle_count() const;
  /// Materials that particles are made of.
  std::vector<std::uint8_t> particle_materials() const;
};

/// Reads and checks the participant's table; reads the wall meshes it names. @throws io::UserError
Scene read_scene(const io::Table& root, const std::string& name);

}  // namespace acopla::dem
