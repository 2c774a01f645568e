// Dense random packings: points at random grow into particles and push each other apart.
#pragma once

#include <span>
#include <vector>

#include "dem/feeding/region.h"

namespace acopla::dem {

struct Packing {
  std::vector<Vec3> at;       ///< centres, one a radius
  bool jammed = false;        ///< the radii as given do not fit; then `at` and `solid_fraction` are of the largest that did
  double solid_fraction = 0;  ///< of the region, reached without any overlap
  int iterations = 0;         ///< of the relaxation, all stages together
};

/// How much larger than asked for the particles are while they push each other apart, and how much of their radii they may then
/// still overlap: at their true radii there is no overlap at all.
inline constexpr double growth_margin = 1e-4;

/// Packs particles of these radii into the region, whose walls are rigid; it must hold the largest. Radii grow in stages, after
/// each of which the energy of linear springs between what overlaps is minimised by FIRE (Bitzek et al. 2006; half a step back
/// on an uphill as in Guénolé et al. 2020). Where that jams near the target, the packing is annealed twice, more slowly the second
/// time. Random close packing bounds what can be reached (near 0.84 for equal discs, 0.64 for equal spheres), and the loose layers
/// at the walls lower it: equal spheres reach 0.62 in a cube of 14 diameters, 0.605 in one of 10.
Packing grow_packing(const Region& region, std::span<const double> radii, Random& random);

}  // namespace acopla::dem
