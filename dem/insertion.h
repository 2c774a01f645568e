// Placing spheres at random without overlap.
#pragma once

#include "dem/particles.h"
#include "dem/scene.h"

namespace acopla::dem {

/// Uniform doubles in [0, 1) that are the same on every machine (the standard's distributions are not).
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}
  /// SplitMix64 (Steele, Lea & Flood 2014).
  double uniform() {
    std::uint64_t z = (state_ += 0x9e3779b97f4a7c15ULL);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
    return static_cast<double>((z ^ (z >> 31)) >> 11) * 0x1p-53;
  }

 private:
  std::uint64_t state_;
};

/// Places every insertion of the scene, larger spheres first, clear of each other and of the walls' triangles.
/// @throws io::UserError, located at the count, when a sphere finds no place in 20,000 tries
Particles insert_particles(const Scene& scene, const WallSet& walls);

}  // namespace acopla::dem
