// What is there when the first step begins: every [[X.insert]] of a case turned into particles.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dem/feeding/place.h"
#include "dem/feeding/sizes.h"
#include "io/error.h"

namespace acopla::dem {

/// A particle that is about to be.
struct NewParticle {
  Vec3 at = Vec3::Zero();        ///< [m]
  double radius = 0;             ///< [m]
  Vec3 velocity = Vec3::Zero();  ///< [m/s]
  Vec3 spin = Vec3::Zero();      ///< [rad/s]
  std::uint8_t material = 0;
};

enum class Placing { given, random, lattice, growth };

/// One [[X.insert]]: particles as given, or of a distribution of sizes put into a region.
struct Filling {
  std::string name;  ///< of the table, for messages
  std::uint8_t material = 0;
  double density = 0;  ///< [kg/m³]
  Placing placing = Placing::random;
  std::vector<NewParticle> particles;     ///< Placing::given: all there is; they may overlap, as a test may want
  std::optional<SizeDistribution> sizes;  ///< the others: these sizes
  std::optional<Region> region;           ///< and this region
  /// How much, one of: `count`; `mass` [kg] (per metre of depth in 2D); `solid_fraction` of the region. For a lattice none of
  /// them fills it; for growth `count` and `solid_fraction` together scale all diameters by one factor.
  std::optional<std::size_t> count;
  std::optional<double> mass, solid_fraction;
  Lattice lattice;
  Vec3 velocity = Vec3::Zero(), spin = Vec3::Zero();
  std::optional<std::uint64_t> seed;  ///< of its own
  io::Location where;                 ///< of the amount

  double largest_radius() const;
  double smallest_radius() const;
};

struct FillSettings {
  int dimension = 3;
  Vec3 gravity = Vec3::Zero();  ///< only its direction counts: lattices grow from where it points to
  std::uint64_t seed = 1;       ///< of the fillings without a seed of their own; each filling has streams of its own
  Vacancy vacant = {};          ///< clear of the walls? may be empty
};

/// The radii that filling `index` of a case will have, without placing them (in a lattice without amount: the sites are counted).
/// For the critical step, the memory, and so on.
std::vector<double> radii_of(const Filling& filling, std::size_t index, const FillSettings& settings);

/// Places all fillings: the given particles, then grown packings, then lattices, then the random ones, of all fillings together
/// the larger particles first. The particles come in the order of the fillings; two calls give the same.
/// @throws io::UserError, located at the amount, when there is no room, saying how much there is
std::vector<NewParticle> fill(std::span<const Filling> fillings, const FillSettings& settings);

}  // namespace acopla::dem
