// Places for particles of given sizes, at random and clear of each other.
#pragma once

#include <cstddef>
#include <vector>

#include "dem/feeding/occupancy.h"
#include "dem/feeding/region.h"

namespace acopla::dem {

/// A place at random for a whole particle in the region: free in `occupancy`, and `vacant` (where given) agrees.
/// @return false after so many tries without one
bool place_at_random(const Region& region, double radius, const Occupancy& occupancy, const Vacancy& vacant, Random& random, int tries,
                     Vec3& at);

/// Random placing one after another, larger particles first. It ends where no hole is left: near 0.54 of a region for equal
/// discs and 0.38 for equal spheres after infinitely many tries (random sequential addition), at about 0.5 and 0.3 after
/// `placing_tries`.
inline constexpr int placing_tries = 20000;

/// Regular arrangements; `spacing` is always the distance of nearest neighbours.
enum class LatticeKind { square, hexagonal, cubic, fcc, hcp };

struct Lattice {
  LatticeKind kind = LatticeKind::cubic;
  double spacing = 0;  ///< [m]; 0: the largest diameter
  double jitter = 0;   ///< part of the free room (half the spacing less the radius) by which a particle may leave its site
};

/// Sites for whole particles of `radius`, in layers across the axis that gravity follows most, from the side it points to
/// (without gravity: from low z, or low y in two dimensions). In a box the first site touches the low corner's walls.
/// @param at_most  as many as this; all there are when 0
std::vector<Vec3> lattice_sites(const Region& region, const Lattice& lattice, double radius, const Vec3& gravity, const Vacancy& vacant,
                                std::size_t at_most);

/// Moves a particle off its site by up to the lattice's jitter, in any direction: particles of the same lattice stay clear of
/// each other, and inside the region.
Vec3 jittered(const Vec3& site, double radius, const Region& region, const Lattice& lattice, Random& random);

}  // namespace acopla::dem
