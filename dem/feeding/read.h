// The tables [[X.insert]], [[X.inlet]] and [[X.outlet]] of a case. Lengths in metres, times in seconds, masses in kilograms (in two
// dimensions per metre of depth). Whatever is wrong is an io::UserError located at the key.
//
//   [[X.insert]]
//   material = "glass"
//   particles = [{ at = [0, 0, 1], diameter = 0.04, velocity = [0, 0, 0], spin = [0, 0, 0] }]   # all there is, or:
//   diameter = 0.04                          # or sizes = one of
//     { groups = [{ diameter = 0.013, count = 105 }, …] }
//     { sieve = { openings = [2.8e-3, 2.38e-3, …], retained = [0.8, 19.67, …], largest = 3.35e-3 } }    # or passing = [99.2, …]
//     { uniform = [0.01, 0.02] }             # each of these three with by = "number" (default) or "mass"
//     { normal = { mean = 0.02, deviation = 0.002, limits = [0.014, 0.026] } }               # limits: ±3 deviations
//     { lognormal = { median = 0.02, deviation = 0.2, limits = [0.011, 0.036] } }            # deviation of ln d
//   count = 2000                             # or mass = 12.5, or solid_fraction = 0.4
//   place = "random"                         # "lattice", "growth"
//   lattice = { kind = "cubic", spacing = 0.045, jitter = 0.5 }   # fcc, hcp; 2D: square, hexagonal
//   region = { box = [[0, 0, 0], [1, 1, 1]] }                     # or as in read_region
//   velocity = [0, 0, -1]
//   spin = [0, 0, 5]                         # a number in 2D
//   seed = 7                                 # that of the scene
//
//   [[X.inlet]]: material, diameter or sizes, region, velocity, spin, seed as above; rate [kg/s], from = 0, until (never)
//   [[X.outlet]]: region, name
#pragma once

#include <string>
#include <vector>

#include "dem/feeding/fill.h"
#include "dem/feeding/inlet.h"
#include "io/case_table.h"

namespace acopla::dem {

/// What the tables refer to.
struct FeedingScope {
  int dimension = 3;
  std::vector<std::string> materials;  ///< names
  std::vector<double> densities;       ///< [kg/m³], one a material
  std::uint64_t seed = 1;              ///< of the scene; an inlet without a seed of its own gets a stream of it
};

Filling read_filling(const io::Table& table, const FeedingScope& scope);
/// @param index  of the inlet in the case: its stream of random numbers
Inlet read_inlet(const io::Table& table, const FeedingScope& scope, std::size_t index);
Outlet read_outlet(const io::Table& table, const FeedingScope& scope);

/// `diameter` or `sizes` of a table.
SizeDistribution read_sizes(const io::Table& table, int dimension);
/// `region` of a table: { box = [[…], […]] }, { sphere = { centre, radius } }, { cylinder = { from, to, radius } }; in two dimensions
/// { box = … } or { disc = { centre, radius } }.
Region read_region(const io::Table& table, int dimension);

}  // namespace acopla::dem
