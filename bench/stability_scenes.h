// Scenes of the stability study: a handful of particles in a box of planes, with any laws, sizes and densities.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "dem/engine.h"
#include "dem/step.h"

namespace acopla::bench {

using dem::Vec3;

struct LawChoice {
  std::string normal, tangential = "none", rolling = "none";
  std::string text() const { return normal + " + " + tangential + " + " + rolling; }
};

/// The ten combinations of built-in laws.
std::vector<LawChoice> all_laws();

/// One kind of particle; the first is also the walls' material.
struct Species {
  double density = 2500, radius = 0.01, shear_modulus = 5e6;
};

struct Setting {
  int dimension = 3;
  LawChoice laws{"hertz", "mindlin", "none"};
  double restitution = 0.5, friction = 0.5, rolling_friction = 0.1;
  double stiffness = 1e5;  ///< of linear springs [N/m]
  double stiffness_ratio = 20;
  std::vector<Species> species{Species{}};
  double gravity = 0;
  bool ledger = false, allow_unstable = false;
  std::string more;  ///< further lines of the participant's table
};

struct Body {
  Vec3 at, velocity = Vec3::Zero(), spin = Vec3::Zero();
  double radius = 0.01;
  std::size_t species = 0;
};

/// Without walls; what is put in is at most within [-reach, reach] of the origin. @param reach  [m]
dem::Scene scene_of(const Setting& setting, double reach);
/// Planes around [0, side]^dimension, or only the one below where `open`; the first is the floor.
std::vector<dem::Wall> box(int dimension, double side, bool open = false);
std::unique_ptr<dem::Engine> engine_of(dem::Scene scene, const std::vector<Body>& bodies, std::vector<dem::Wall> walls);

/// Particles in a closed box, at rest under their own squeeze.
struct Bed {
  std::vector<Body> bodies;
  double side = 0, mean_overlap = 0;  ///< [m]; over the smaller radius
  std::size_t contacts = 0;
  bool at_rest = false;
};
/// Packs `per_edge`^dimension particles (species in turn; radii ± 15 % where there is one only) and squeezes them until the mean overlap
/// over the smaller radius is `overlap`, without friction. The law's normal part decides where they come to rest.
Bed squeezed_bed(Setting setting, int per_edge, double overlap, std::uint64_t seed);

}  // namespace acopla::bench
