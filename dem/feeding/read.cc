#include "dem/feeding/read.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

namespace acopla::dem {
namespace {

constexpr io::Range solid_range{0, 1, true, true, "A solid fraction is a part of the region's volume."};
constexpr std::int64_t most_particles = 2'000'000'000;

// The one key of `keys` that the table has.
std::string only_key(const io::Table& table, const std::vector<std::string>& keys) {
  std::vector<std::string> found;
  for (const auto& key : keys)
    if (table.has(key)) found.push_back(key);
  if (found.size() > 1) table.fail(found[1], fmt::format("and {} are both given. Keep one.", found[0]));
  if (found.empty()) {
    for (const auto& key : table.keys())
      if (const auto near = io::nearest_word(key, keys)) table.fail(key, fmt::format("is not a known key. Did you mean {}?", *near));
    table.fail(fmt::format("needs one of {}.", fmt::join(keys, ", ")));
  }
  return found[0];
}

std::pair<double, double> limits_of(const io::Table& table, std::string_view key) {
  const auto limits = table.numbers(key);
  if (limits.size() != 2) table.fail(key, fmt::format("must be two diameters, [smallest, largest], not {} numbers.", limits.size()));
  if (!(limits[0] > 0)) table.fail(key, fmt::format("starts at {:.6g}: a diameter is positive.", limits[0]));
  if (!(limits[0] < limits[1]))
    table.fail(key, fmt::format("= [{:.6g}, {:.6g}] is not [smallest, largest].{}", limits[0], limits[1],
                                limits[0] == limits[1] ? " For one size write diameter." : ""));
  return {limits[0], limits[1]};
}

By by(const io::Table& table) { return table.choice("by", {"number", "mass"}, "number") == "mass" ? By::mass : By::number; }

SizeDistribution read_groups(const io::Table& table, int dimension) {
  std::vector<SizeGroup> groups;
  for (const auto& group : table.list("groups"))
    groups.push_back({group.number("diameter", io::positive), static_cast<std::size_t>(group.integer("count", 1, most_particles))});
  if (groups.empty()) table.fail("groups", "is empty. Give e.g. [{ diameter = 0.01, count = 100 }].");
  return SizeDistribution::groups(groups, dimension);
}

// Each mass stands on the sieve of the same place in the list, having passed the one before; a last one is in the pan.
SizeDistribution read_sieve(const io::Table& table, int dimension) {
  auto openings = table.numbers("openings");
  const auto kind = only_key(table, {"retained", "passing"});
  auto masses = table.numbers(kind);
  const std::size_t sieves = openings.size();
  if (sieves == 0) table.fail("openings", "is empty. Give the openings of the sieves [m], the coarsest first.");
  for (std::size_t k = 0; k < sieves; ++k)
    if (!(openings[k] > 0) || (k > 0 && !(openings[k] < openings[k - 1])))
      table.fail("openings", "must be positive and fall from sieve to sieve: the coarsest first.");
  for (const double mass : masses)
    if (mass < 0) table.fail(kind, fmt::format("holds {:.6g}: a mass is not negative.", mass));
  if (kind == "passing") {
    if (masses.size() != sieves)
      table.fail(kind, fmt::format("has {} values for {} openings. Give the mass per cent that passes each sieve.", masses.size(), sieves));
    if (masses.front() > 100) table.fail(kind, fmt::format("starts at {:.6g} %: no more than 100 % can pass.", masses.front()));
    std::vector<double> retained{100 - masses.front()};
    for (std::size_t k = 1; k < sieves; ++k) retained.push_back(masses[k - 1] - masses[k]);
    retained.push_back(masses.back());
    if (*std::min_element(retained.begin(), retained.end()) < 0)
      table.fail(kind, "rises from a coarser sieve to a finer one. What passes the finer has passed the coarser too.");
    masses = retained;
  } else if (masses.size() != sieves && masses.size() != sieves + 1) {
    table.fail(kind, fmt::format("has {} values for {} openings. Give the mass on each sieve, and perhaps that in the pan as one more.",
                                 masses.size(), sieves));
  }
  masses.resize(sieves + 1, 0.0);
  if (!(*std::max_element(masses.begin(), masses.end()) > 0)) table.fail(kind, "holds no mass at all.");
  const auto largest = table.optional_number("largest", io::positive), smallest = table.optional_number("smallest", io::positive);
  if (masses.front() > 0 && !largest)
    table.fail(kind, fmt::format("leaves mass on the coarsest sieve, {:.6g} m, without an upper size. Add largest, e.g. the opening of the "
                                 "next coarser sieve.",
                                 openings.front()));
  if (masses.back() > 0 && !smallest)
    table.fail(kind, fmt::format("lets mass through the finest sieve, {:.6g} m, without a lower size. Add smallest.", openings.back()));
  if (largest && *largest <= openings.front())
    table.fail("largest", fmt::format("= {:.6g} must be above the coarsest opening, {:.6g} m.", *largest, openings.front()));
  if (smallest && *smallest >= openings.back())
    table.fail("smallest", fmt::format("= {:.6g} must be below the finest opening, {:.6g} m.", *smallest, openings.back()));
  std::vector<SieveClass> classes;
  for (std::size_t k = 0; k <= sieves; ++k)
    if (masses[k] > 0) classes.push_back({k < sieves ? openings[k] : *smallest, k > 0 ? openings[k - 1] : *largest, masses[k]});
  return SizeDistribution::sieved(classes, dimension);
}

SizeDistribution read_normal(const io::Table& sizes, int dimension) {
  const auto table = sizes.table("normal");
  const double mean = table.number("mean", io::positive), deviation = table.number("deviation", io::positive);
  if (!table.has("limits") && mean <= 3 * deviation)
    table.fail("deviation",
               fmt::format("= {:.6g} reaches to zero: the limits are mean ± 3 deviations unless given. Add limits = [smallest, "
                           "largest] with smallest above 0, or use lognormal.",
                           deviation));
  const auto [low, high] = table.has("limits") ? limits_of(table, "limits") : std::pair(mean - 3 * deviation, mean + 3 * deviation);
  return SizeDistribution::normal(mean, deviation, low, high, by(sizes), dimension);
}

SizeDistribution read_lognormal(const io::Table& sizes, int dimension) {
  constexpr io::Range deviations{0, 3, true, false,
                                 "It is the deviation of ln d, about the relative width; 3 is a ratio of 20 either way."};
  const auto table = sizes.table("lognormal");
  const double median = table.number("median", io::positive), deviation = table.number("deviation", deviations);
  const auto [low, high] =
      table.has("limits") ? limits_of(table, "limits") : std::pair(median * std::exp(-3 * deviation), median * std::exp(3 * deviation));
  return SizeDistribution::lognormal(median, deviation, low, high, by(sizes), dimension);
}

std::uint8_t read_material(const io::Table& table, const FeedingScope& scope) {
  const auto name = table.choice("material", scope.materials);
  return static_cast<std::uint8_t>(std::find(scope.materials.begin(), scope.materials.end(), name) - scope.materials.begin());
}

Vec3 read_spin(const io::Table& table, int dimension) {
  if (!table.has("spin")) return Vec3::Zero();
  if (dimension == 3) return table.vector("spin", 3);
  if (!table.is_number("spin")) table.fail("spin", "must be a number in two dimensions: the spin about z [rad/s].");
  return Vec3(0, 0, table.number("spin"));
}

Vec3 read_velocity(const io::Table& table, int dimension) {
  return table.has("velocity") ? table.vector("velocity", dimension) : Vec3::Zero();
}

void check_holds(const io::Table& table, const Region& region, double radius) {
  if (!region.holds(radius))
    table.fail("region",
               fmt::format("is thinner than one diameter of {:.4g} m: no whole {} fits.", 2 * radius, particle_word(region.dimension())));
}

std::vector<NewParticle> read_particles(const io::Table& table, std::uint8_t material, int dimension) {
  std::vector<NewParticle> particles;
  for (const auto& entry : table.list("particles"))
    particles.push_back({entry.vector("at", dimension), entry.number("diameter", io::positive) / 2, read_velocity(entry, dimension),
                         read_spin(entry, dimension), material});
  if (particles.empty()) table.fail("particles", "is empty. Give e.g. [{ at = [0, 0, 0], diameter = 0.01 }].");
  for (const auto* key : {"diameter", "sizes", "count", "mass", "solid_fraction", "place", "lattice", "region", "velocity", "spin", "seed"})
    if (table.has(key)) table.fail(key, "does not go with particles, which say all themselves. Put it there, or into another insert.");
  return particles;
}

Lattice read_lattice(const io::Table& insert, const Filling& filling, int dimension) {
  Lattice lattice;
  lattice.kind = dimension == 2 ? LatticeKind::square : LatticeKind::cubic;
  const double diameter = 2 * filling.largest_radius();
  if (insert.has("lattice")) {
    const auto table = insert.table("lattice");
    if (table.has("kind")) {
      const std::vector<std::string> names =
          dimension == 2 ? std::vector<std::string>{"square", "hexagonal"} : std::vector<std::string>{"cubic", "fcc", "hcp"};
      const std::vector<LatticeKind> kinds = dimension == 2 ? std::vector{LatticeKind::square, LatticeKind::hexagonal}
                                                            : std::vector{LatticeKind::cubic, LatticeKind::fcc, LatticeKind::hcp};
      const auto name = table.choice("kind", names);
      lattice.kind = kinds[static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin())];
    }
    lattice.spacing = table.number("spacing", io::positive, 0);
    if (lattice.spacing > 0 && lattice.spacing < diameter * (1 - 1e-12))
      table.fail("spacing",
                 fmt::format("= {:.6g} is below the largest diameter, {:.6g} m: neighbours would overlap.", lattice.spacing, diameter));
    lattice.jitter = table.number("jitter", io::fraction, 0);
    if (lattice.jitter > 0 && lattice.spacing == 0)
      table.fail("jitter",
                 fmt::format("has no room while the particles touch. Add a spacing above the largest diameter, e.g. spacing = {:.4g}.",
                             1.1 * diameter));
  }
  if (lattice.spacing == 0) lattice.spacing = diameter;
  return lattice;
}

// count, mass or solid_fraction, and which of them goes with what.
void read_amount(const io::Table& table, Filling& filling) {
  const auto own = filling.sizes->own_count();
  if (table.has("count")) filling.count = static_cast<std::size_t>(table.integer("count", 1, most_particles));
  filling.mass = table.optional_number("mass", io::positive);
  filling.solid_fraction = table.optional_number("solid_fraction", solid_range);
  for (const auto* key : {"count", "solid_fraction", "mass"})
    if (table.has(key)) filling.where = table.location(key);
  if (filling.mass && (filling.count || filling.solid_fraction))
    table.fail("mass", fmt::format("and {} are both given. Keep one.", filling.count ? "count" : "solid_fraction"));
  if (own > 0) {
    if (filling.count && *filling.count != own)
      table.fail("count", fmt::format("= {} is not the sum of the groups' counts, {}. Remove it.", *filling.count, own));
    // The groups' own counts, unless an amount makes them proportions.
    const bool scaled = filling.placing == Placing::growth && filling.count;
    if (!filling.mass && (!filling.solid_fraction || scaled)) filling.count = own;
  }
  if (filling.count && filling.solid_fraction && filling.placing != Placing::growth)
    table.fail("solid_fraction", "and count are both given. Keep one; only place = \"growth\" takes both, and scales the diameters.");
  if (!filling.count && !filling.mass && !filling.solid_fraction && filling.placing != Placing::lattice)
    table.fail("needs an amount: count, mass or solid_fraction.");
}

}  // namespace

SizeDistribution read_sizes(const io::Table& table, int dimension) {
  if (only_key(table, {"diameter", "sizes"}) == "diameter") return SizeDistribution::one(table.number("diameter", io::positive), dimension);
  const auto sizes = table.table("sizes");
  const auto law = only_key(sizes, {"groups", "sieve", "uniform", "normal", "lognormal"});
  if ((law == "groups" || law == "sieve") && sizes.has("by"))
    sizes.fail("by", fmt::format("does not go with {}, which is by {}. Remove it.", law, law == "sieve" ? "mass" : "number"));
  if (law == "groups") return read_groups(sizes, dimension);
  if (law == "sieve") return read_sieve(sizes.table("sieve"), dimension);
  if (law == "normal") return read_normal(sizes, dimension);
  if (law == "lognormal") return read_lognormal(sizes, dimension);
  const auto [low, high] = limits_of(sizes, "uniform");
  return SizeDistribution::uniform(low, high, by(sizes), dimension);
}

Region read_region(const io::Table& table, int dimension) {
  const auto region = table.table("region");
  for (const auto* other : {"sphere", "cylinder", "disc"})
    if (region.has(other) && (std::string_view(other) == "disc") != (dimension == 2))
      region.fail(other, fmt::format("is no region in {} dimensions. Use {}.", dimension,
                                     dimension == 2 ? "box or disc" : "box, sphere or cylinder"));
  const auto shape =
      only_key(region, dimension == 2 ? std::vector<std::string>{"box", "disc"} : std::vector<std::string>{"box", "sphere", "cylinder"});
  if (shape == "box") {
    const auto corners = region.vectors("box", dimension);
    if (corners.size() != 2)
      region.fail("box", dimension == 2 ? "must be two corners, [[x, y], [x, y]]." : "must be two corners, [[x, y, z], [x, y, z]].");
    return Region::box(corners[0], corners[1], dimension);
  }
  const auto values = region.table(shape);
  const double radius = values.number("radius", io::positive);
  if (shape != "cylinder") return Region::ball(values.vector("centre", dimension), radius, dimension);
  const Vec3 from = values.vector("from", 3), to = values.vector("to", 3);
  if (!((to - from).norm() > 0)) values.fail("to", "is the same point as from. They are the centres of the cylinder's two ends.");
  return Region::cylinder(from, to, radius);
}

Filling read_filling(const io::Table& table, const FeedingScope& scope) {
  Filling filling;
  filling.name = table.name();
  filling.where = table.location();
  filling.material = read_material(table, scope);
  filling.density = scope.densities[filling.material];
  if (table.has("particles")) {
    filling.placing = Placing::given;
    filling.particles = read_particles(table, filling.material, scope.dimension);
    return filling;
  }
  const auto place = table.choice("place", {"random", "lattice", "growth"}, "random");
  filling.placing = place == "random" ? Placing::random : place == "lattice" ? Placing::lattice : Placing::growth;
  filling.sizes = read_sizes(table, scope.dimension);
  filling.region = read_region(table, scope.dimension);
  read_amount(table, filling);
  if (filling.placing == Placing::lattice)
    filling.lattice = read_lattice(table, filling, scope.dimension);
  else if (table.has("lattice"))
    table.fail("lattice", fmt::format("has no effect with place = \"{}\". Add place = \"lattice\" or remove it.", place));
  if (!(filling.count && filling.solid_fraction)) check_holds(table, *filling.region, filling.largest_radius());
  filling.velocity = read_velocity(table, scope.dimension);
  filling.spin = read_spin(table, scope.dimension);
  if (table.has("seed")) filling.seed = static_cast<std::uint64_t>(table.integer("seed", 0, std::numeric_limits<std::int64_t>::max()));
  return filling;
}

Inlet read_inlet(const io::Table& table, const FeedingScope& scope, std::size_t index) {
  const auto material = read_material(table, scope);
  const auto density = scope.densities[material];
  for (const auto* key : {"count", "mass", "solid_fraction"})
    if (table.has(key)) table.fail(key, "has no effect on an inlet, which has a rate [kg/s]. Use insert, or remove it.");
  const double rate = table.number("rate", io::positive);
  const double from = table.number("from", io::non_negative, 0);
  const double until = table.number("until", io::positive, std::numeric_limits<double>::infinity());
  if (until <= from) table.fail("until", fmt::format("= {:.6g} is not after from = {:.6g}.", until, from));
  Inlet inlet{table.name(),
              material,
              density,
              rate,
              from,
              until,
              read_sizes(table, scope.dimension),
              read_region(table, scope.dimension),
              read_velocity(table, scope.dimension),
              read_spin(table, scope.dimension),
              0,
              table.location("rate")};
  check_holds(table, inlet.region, inlet.sizes.largest_radius());
  const auto stream = Random::stream(scope.seed, 0x696e6c6574 + index).state();  // far from the fillings' streams
  inlet.seed = table.has("seed") ? static_cast<std::uint64_t>(table.integer("seed", 0, std::numeric_limits<std::int64_t>::max())) : stream;
  return inlet;
}

Outlet read_outlet(const io::Table& table, const FeedingScope& scope) {
  return {table.text("name", table.name()), read_region(table, scope.dimension)};
}

}  // namespace acopla::dem
