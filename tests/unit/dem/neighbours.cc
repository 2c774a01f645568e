// The neighbour search against looking at every pair, its cost in counts, and the order along the curve.
#include "dem/neighbours.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <thread>

#include "dem/feeding/random.h"

namespace acopla::dem::test {
namespace {

using Positions = std::vector<Record>;

struct Bed {
  std::string name;
  Positions positions;
  double skin;
};

// --- beds

// Uniform in a box; radii by a function of a uniform number.
Positions uniform(std::size_t count, const Vec3& low, const Vec3& size, const std::function<double(double)>& radius,
                  std::uint64_t seed = 1) {
  Random random(seed);
  Positions positions;
  for (std::size_t k = 0; k < count; ++k) {
    const double x = random.uniform(), y = random.uniform(), z = random.uniform();
    positions.push_back({low[0] + size[0] * x, low[1] + size[1] * y, low[2] + size[2] * z, radius(random.uniform())});
  }
  return positions;
}

auto equal(double radius) {
  return [radius](double) { return radius; };
}
auto log_uniform(double largest, double ratio) {
  return [=](double u) { return largest * std::pow(ratio, -u); };
}
// Equal mass in every octave of size: most particles are small.
auto equal_masses(double largest, double ratio) {
  return [=](double u) { return largest / std::cbrt(1 + u * (ratio * ratio * ratio - 1)); };
}

Positions sorted_along_curve(const Positions& positions) {
  std::vector<std::uint32_t> order;
  curve_order(positions, order);
  Positions sorted;
  for (const auto k : order) sorted.push_back(positions[k]);
  return sorted;
}

// A cubic lattice whose neighbours just touch: centres fall on the borders of the cells.
Positions lattice(std::uint32_t n, double spacing, double radius, const Vec3& low) {
  Positions positions;
  for (std::uint32_t k = 0; k < n * n * n; ++k)
    positions.push_back({low[0] + spacing * (k % n), low[1] + spacing * (k / n % n), low[2] + spacing * (k / (n * n)), radius});
  return positions;
}

Positions clusters_and_outliers() {
  Positions positions;
  for (int k = 0; k < 4; ++k) {
    const Vec3 low(100.0 * k, -50.0 * k * k, 7.0 * k);
    const auto cluster = uniform(500, low, Vec3::Constant(0.12), log_uniform(0.02, 30), 10 + static_cast<std::uint64_t>(k));
    positions.insert(positions.end(), cluster.begin(), cluster.end());
  }
  for (const double far : {-1e7, 3e6, 1e8}) positions.push_back({far, -far, 2 * far, 0.01});
  return positions;
}

// Spheres of radius 1 at random, each with a layer of spheres of radius 0.01.
Positions large_among_small(std::size_t large, std::size_t small) {
  auto positions = uniform(large, Vec3::Zero(), Vec3::Constant(4), equal(1), 5);
  Random random(6);
  for (std::size_t k = 0; k < small; ++k) {
    const double z = 2 * random.uniform() - 1, angle = 2 * M_PI * random.uniform(), r = 1.01 + 0.08 * random.uniform();
    const auto& centre = positions[k % large];
    const double across = r * std::sqrt(1 - z * z);
    positions.push_back({centre.x + across * std::cos(angle), centre.y + across * std::sin(angle), centre.z + r * z, 0.01});
  }
  return positions;
}

// A block of small spheres, cut by the surfaces of spheres 80 times as large.
Positions large_through_small() {
  auto positions = uniform(3000, Vec3::Zero(), Vec3::Constant(0.2), equal(0.006), 4);
  for (const Vec3& at : {Vec3(0.1, 0.1, -0.4), Vec3(0.6, 0.15, 0.1), Vec3(-0.28, -0.28, 0.1)}) {
    positions.push_back({at[0], at[1], at[2], 0.48});
    positions.insert(positions.begin(), {at[1], at[0], at[2], 0.48});
  }
  return positions;
}

std::vector<Bed> beds() {
  const Vec3 zero = Vec3::Zero(), one = Vec3::Ones(), flat(1, 1, 0);
  std::vector<Bed> beds{
      {"equal", uniform(3000, zero, {1, 1, 0.3}, equal(0.03)), 0.006},
      {"a_factor_of_three", uniform(2000, zero, {1, 1, 0.3}, [](double u) { return 0.01 + 0.02 * u; }), 0.01},
      {"ratio_100", uniform(3000, zero, one, log_uniform(0.15, 100)), 0.0005},
      {"ratio_100_equal_masses", uniform(3000, zero, one, equal_masses(0.3, 100)), 0.0005},
      {"ratio_1000", uniform(3000, zero, one, log_uniform(0.3, 1000)), 0.0001},
      {"ratio_1e6", uniform(1500, zero, one, log_uniform(0.3, 1e6)), 0.0},
      {"large_among_small", large_among_small(4, 2500), 0.003},
      {"large_through_small", large_through_small(), 0.001},
      {"discs", uniform(3000, zero, flat, equal(0.01)), 0.002},
      {"discs_ratio_100", uniform(3000, zero, flat, log_uniform(0.15, 100)), 0.0005},
      {"discs_at_a_height", uniform(2000, {0, 0, 3.7}, flat, log_uniform(0.1, 10)), 0.001},
      {"clusters_and_outliers", clusters_and_outliers(), 0.0005},
      {"far_from_the_origin", uniform(2000, {1e6, -2e6, 3e6}, one, equal(0.04)), 0.01},
      {"line", uniform(2000, zero, {0, 1, 0}, log_uniform(0.001, 50)), 0.0001},
      {"slab_thinner_than_a_cell", uniform(2000, zero, {1, 1, 0.01}, log_uniform(0.03, 20)), 0.001},
      {"points_with_a_skin", uniform(2000, zero, one, equal(0)), 0.05},
      {"points_without", uniform(500, zero, one, equal(0)), 0.0},
      {"points_and_spheres", uniform(1000, zero, one, [](double u) { return u < 0.5 ? 0 : 0.05; }), 0.0},
      {"all_in_one_place", Positions(300, Record{1, 2, 3, 0.5}), 0.1},
      {"lattice", lattice(12, 0.1, 0.05 * (1 + 1e-9), {0.3, -0.7, 1.1}), 0.0},
      {"lattice_of_two_sizes", lattice(12, 0.1, 0.05 * (1 + 1e-9), {1e3 / 3, -0.7, 1.1}), 0.0},
      {"two", {{0, 0, 0, 1}, {1.9, 0, 0, 1}}, 0.0},
      {"one", {{0, 0, 0, 1}}, 0.1},
      {"none", {}, 0.1}};
  for (std::size_t k = 0; k < 12 * 12 * 12; k += 3)
    for (auto& bed : beds)
      if (bed.name == "lattice_of_two_sizes") bed.positions[k].w /= 8;
  return beds;
}

// --- the reference

bool near(const Record& a, const Record& b, double skin) { return (a.vector() - b.vector()).norm() < a.w + b.w + skin; }

PairList every_pair(const Positions& positions, double skin) {
  PairList pairs;
  pairs.start.push_back(0);
  for (std::uint32_t i = 0; i < positions.size(); ++i) {
    for (std::uint32_t j = i + 1; j < positions.size(); ++j)
      if (near(positions[i], positions[j], skin)) pairs.second.push_back(j);
    pairs.start.push_back(static_cast<std::uint32_t>(pairs.second.size()));
  }
  return pairs;
}

PairList found_pairs(const Positions& positions, double skin) {
  HierarchicalGrid grid;
  grid.build(positions, skin);
  PairList rows;
  grid.find_pairs(0, static_cast<std::uint32_t>(positions.size()), rows);
  return rows;
}

void expect_same(const PairList& found, const PairList& expected) {
  EXPECT_EQ(found.start, expected.start);
  EXPECT_EQ(found.second, expected.second);
}

class EveryBed : public testing::TestWithParam<Bed> {};

// No distance of these beds is within rounding of its limit, so that the lists agree exactly.
TEST_P(EveryBed, RowsAreThoseOfLookingAtEveryPair) {
  const auto& [name, positions, skin] = GetParam();
  expect_same(found_pairs(positions, skin), every_pair(positions, skin));
}

TEST_P(EveryBed, RowsAreThoseOfLookingAtEveryPairAlsoAlongTheCurveAndBackwards) {
  auto positions = sorted_along_curve(GetParam().positions);
  expect_same(found_pairs(positions, GetParam().skin), every_pair(positions, GetParam().skin));
  std::reverse(positions.begin(), positions.end());
  expect_same(found_pairs(positions, GetParam().skin), every_pair(positions, GetParam().skin));
}

TEST_P(EveryBed, RowsDoNotDependOnTheirSplit) {
  const auto& [name, positions, skin] = GetParam();
  const auto count = static_cast<std::uint32_t>(positions.size());
  HierarchicalGrid grid;
  grid.build(positions, skin);
  PairList whole;
  grid.find_pairs(0, count, whole);
  for (const std::uint32_t parts : {2u, 3u, 8u}) {
    // Each part on a thread of its own.
    std::vector<PairList> rows(parts);
    std::vector<std::thread> threads;
    const auto bound = [&](std::uint32_t part) { return static_cast<std::uint32_t>(std::uint64_t{count} * part / parts); };
    for (std::uint32_t part = 0; part < parts; ++part)
      threads.emplace_back([&, part] { grid.find_pairs(bound(part), bound(part + 1), rows[part]); });
    for (auto& thread : threads) thread.join();
    PairList joined;
    joined.start.push_back(0);
    for (const auto& part : rows) {
      const auto before = static_cast<std::uint32_t>(joined.second.size());
      for (std::size_t k = 1; k < part.start.size(); ++k) joined.start.push_back(before + part.start[k]);
      joined.second.insert(joined.second.end(), part.second.begin(), part.second.end());
      joined.examined += part.examined;
    }
    expect_same(joined, whole);
    EXPECT_EQ(joined.examined, whole.examined);
  }
}

TEST_P(EveryBed, OrderIsAPermutationThatIsKeptOnceSorted) {
  std::vector<std::uint32_t> order, again;
  curve_order(GetParam().positions, order);
  std::vector<std::uint32_t> names(GetParam().positions.size());
  std::iota(names.begin(), names.end(), 0u);
  auto sorted = order;
  std::sort(sorted.begin(), sorted.end());
  EXPECT_EQ(sorted, names);
  curve_order(sorted_along_curve(GetParam().positions), again);
  EXPECT_EQ(again, names);
}

// Only what holds particles is kept: their cells, and those around them on the way up, one a level and particle at most.
TEST_P(EveryBed, MemoryIsBoundedByTheParticles) {
  const auto& positions = GetParam().positions;
  HierarchicalGrid grid;
  grid.build(positions, GetParam().skin);
  EXPECT_LE(grid.cells(), std::max(8 * positions.size() + 1024, grid.levels() * positions.size()));
}

INSTANTIATE_TEST_SUITE_P(HierarchicalGrid, EveryBed, testing::ValuesIn(beds()), [](const auto& bed) { return bed.param.name; });

// --- levels and cost

TEST(HierarchicalGrid, IsOneLevelForNearlyEqualParticles) {
  HierarchicalGrid grid;
  grid.build(uniform(2000, Vec3::Zero(), Vec3::Ones(), [](double u) { return 0.02 + 0.018 * u; }), 0.001);
  EXPECT_EQ(grid.levels(), 1u);
}

// Cells seven times halved between two sizes at 1 : 74 by reach; but a wide distribution whose finest cells would hold one particle each
// is better searched in fewer levels.
TEST(HierarchicalGrid, HasTheLevelsThatThinOut) {
  HierarchicalGrid grid;
  grid.build(large_through_small(), 0.001);
  EXPECT_EQ(grid.levels(), 8u);
  grid.build(uniform(6000, Vec3::Zero(), Vec3::Ones(), log_uniform(0.06, 1000)), 0.0001);
  EXPECT_LE(grid.levels(), 3u);
}

// Points of density ρ find 27 cells of about 8 R³ each; 10 % for the cells that are cut by the border of the box.
TEST(HierarchicalGrid, EqualSpheresLookAtTwentySevenCells) {
  const std::size_t count = 20000;
  const double reach = 2 * 0.0113 + 0.002, density = count;
  const auto rows = found_pairs(uniform(count, Vec3::Zero(), Vec3::Ones(), equal(0.0113)), 0.002);
  EXPECT_LT(static_cast<double>(rows.examined), 27 * std::pow(reach, 3) * density * count * 1.1);
}

// 10⁵ small spheres in a block among a few large ones, 100 times their size: one grid of the large ones' cells would look at every
// pair of the block, 5·10⁹. A small one must not pay for the size of the large, only for touching them.
TEST(HierarchicalGrid, LargeParticlesDoNotSetThePriceOfSmallOnes) {
  const auto small = uniform(100000, Vec3::Zero(), Vec3::Constant(1.05), equal(0.01), 7);
  auto both = uniform(10, Vec3::Zero(), Vec3::Constant(4), equal(1), 8);
  both.insert(both.end(), small.begin(), small.end());
  const auto alone = found_pairs(sorted_along_curve(small), 0.003), mixed = found_pairs(sorted_along_curve(both), 0.003);
  ASSERT_GT(mixed.size(), alone.size());
  // Its own partners as before, ten large ones at most, and of a large one's only those near its surface.
  const double bound = static_cast<double>(alone.examined) + 10 * 1e5 + 4.0 * static_cast<double>(mixed.size() - alone.size());
  EXPECT_LT(static_cast<double>(mixed.examined), bound);
  EXPECT_LT(static_cast<double>(mixed.examined), 15 * static_cast<double>(mixed.size()));
}

TEST(HierarchicalGrid, CostOfSmallParticlesOnLargeOnesIsThatOfTheirPairs) {
  const auto rows = found_pairs(sorted_along_curve(large_among_small(10, 100000)), 0.003);
  EXPECT_LT(static_cast<double>(rows.examined), 25 * static_cast<double>(rows.size()));
}

// Sizes over two and three decades at the same solid volume: the search per particle stays within the same bound, whatever the
// largest. One grid of the largest's cells would look at some thousands a particle.
TEST(HierarchicalGrid, CostOfAParticleIsBoundedWhateverTheRatioOfSizes) {
  for (const double ratio : {10.0, 100.0, 1000.0}) {
    const auto radius = equal_masses(1, ratio);
    double volume = 0;
    for (const auto& p : uniform(50000, Vec3::Zero(), Vec3::Ones(), radius, 9)) volume += 4.0 / 3.0 * M_PI * std::pow(p.w, 3);
    const auto bed = uniform(50000, Vec3::Zero(), Vec3::Constant(std::cbrt(volume / 0.6)), radius, 9);
    const auto rows = found_pairs(sorted_along_curve(bed), 0.1 / ratio);
    EXPECT_LT(static_cast<double>(rows.examined), 27 * 20 * 50000.0) << ratio;
  }
}

TEST(HierarchicalGrid, KeepsItsMemoryFromCallToCall) {
  const auto positions = uniform(3000, Vec3::Zero(), Vec3::Ones(), log_uniform(0.15, 100));
  HierarchicalGrid grid;
  PairList rows;
  grid.build(positions, 0.001);
  grid.find_pairs(0, 3000, rows);
  const auto* const place = rows.second.data();
  for (int k = 0; k < 3; ++k) {
    grid.build(positions, 0.001);
    grid.find_pairs(0, 3000, rows);
    EXPECT_EQ(rows.second.data(), place);
  }
}

TEST(HierarchicalGrid, NothingRemainsOfAnEarlierScene) {
  HierarchicalGrid grid;
  PairList rows;
  for (const auto& bed : beds()) {
    grid.build(bed.positions, bed.skin);
    grid.find_pairs(0, static_cast<std::uint32_t>(bed.positions.size()), rows);
    expect_same(rows, found_pairs(bed.positions, bed.skin));
  }
}

TEST(HierarchicalGrid, RefusesWhatIsNotANumber) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
  HierarchicalGrid grid;
  std::vector<std::uint32_t> order;
  const auto good = uniform(100, Vec3::Zero(), Vec3::Ones(), equal(0.1));
  for (const double bad : {nan, infinity, -infinity})
    for (double Record::*component : {&Record::x, &Record::y, &Record::z, &Record::w})
      for (const std::size_t which : {0u, 50u, 99u}) {
        auto positions = good;
        positions[which].*component = bad;
        EXPECT_THROW(grid.build(positions, 0.01), std::invalid_argument);
        EXPECT_THROW(curve_order(positions, order), std::invalid_argument);
      }
  auto too_wide = good;
  too_wide[0].x = -1.7e308;
  too_wide[1].x = 1.7e308;
  EXPECT_THROW(grid.build(too_wide, 0.01), std::invalid_argument);
  auto negative = good;
  negative[3].w = -0.1;
  EXPECT_THROW(grid.build(negative, 0.01), std::invalid_argument);
  for (const double skin : {nan, infinity, -0.01}) EXPECT_THROW(grid.build(good, skin), std::invalid_argument);
  // It works again after a refusal.
  grid.build(good, 0.01);
  PairList rows;
  grid.find_pairs(0, 100, rows);
  expect_same(rows, every_pair(good, 0.01));
}

// --- order

// Pairs whose particles lie in different parts.
std::size_t crossing(const PairList& pairs, const std::function<std::size_t(std::uint32_t)>& part_of) {
  std::size_t crossing = 0;
  for (std::uint32_t i = 0; i + 1 < pairs.start.size(); ++i)
    for (auto k = pairs.start[i]; k < pairs.start[i + 1]; ++k) crossing += part_of(i) != part_of(pairs.second[k]);
  return crossing;
}

// One particle at random in each cell of a lattice of so many along each axis, so that equal parts in number are equal in volume.
// The parts that cut the fewest pairs are then boxes, so many along each axis; those of the curve may not cut 5 % more.
void expect_parts_like_boxes(const std::array<std::uint32_t, 3>& cells, std::vector<std::array<std::uint32_t, 3>> boxes) {
  Random random(11);
  const bool flat = cells[2] == 1;
  Positions positions;
  for (std::uint32_t k = 0; k < cells[0] * cells[1] * cells[2]; ++k) {
    const double x = random.uniform(), y = random.uniform(), z = random.uniform();
    positions.push_back({k % cells[0] + x, k / cells[0] % cells[1] + y, flat ? 0 : k / (cells[0] * cells[1]) + z, 0.6});
  }
  positions = sorted_along_curve(positions);
  const auto pairs = found_pairs(positions, 0.3);
  for (const auto& n : boxes) {
    const std::size_t parts = std::size_t{n[0]} * n[1] * n[2];
    const auto by_curve = crossing(pairs, [&](std::uint32_t i) { return i * parts / positions.size(); });
    const auto by_box = crossing(pairs, [&](std::uint32_t i) {
      const auto& p = positions[i];
      const auto along = [&](double x, std::size_t d) { return static_cast<std::size_t>(x * n[d] / cells[d]); };
      return (along(p.z, 2) * n[1] + along(p.y, 1)) * n[0] + along(p.x, 0);
    });
    EXPECT_LT(static_cast<double>(by_curve), 1.05 * static_cast<double>(by_box)) << parts << " parts";
  }
}

TEST(CurveOrder, EqualPartsOfACubeAreCubes) { expect_parts_like_boxes({34, 34, 34}, {{2, 1, 1}, {2, 2, 1}, {2, 2, 2}}); }
TEST(CurveOrder, EqualPartsOfAFlatBedAreBoxes) { expect_parts_like_boxes({50, 50, 17}, {{2, 1, 1}, {2, 2, 1}}); }
TEST(CurveOrder, EqualPartsOfASquareAreSquares) { expect_parts_like_boxes({180, 180, 1}, {{2, 1, 1}, {2, 2, 1}, {4, 2, 1}, {4, 4, 1}}); }

// A Hilbert curve never jumps: along a full lattice each particle follows one of its neighbours.
TEST(CurveOrder, NeverJumpsOnALattice) {
  const auto cube = sorted_along_curve(lattice(16, 1, 0.5, Vec3::Zero()));
  for (std::size_t k = 0; k + 1 < cube.size(); ++k) EXPECT_NEAR((cube[k + 1].vector() - cube[k].vector()).norm(), 1, 1e-12);
  Positions square;
  for (int k = 0; k < 32 * 32; ++k) square.push_back({static_cast<double>(k % 32), static_cast<double>(k / 32), 0, 0.5});
  square = sorted_along_curve(square);
  for (std::size_t k = 0; k + 1 < square.size(); ++k) EXPECT_NEAR((square[k + 1].vector() - square[k].vector()).norm(), 1, 1e-12);
}

TEST(CurveOrder, KeepsTheOrderOfParticlesInOneCell) {
  Positions positions = uniform(1000, Vec3::Zero(), Vec3::Ones(), equal(0.3));
  for (std::size_t k = 0; k < positions.size(); ++k)
    if (k % 3 == 0) positions[k] = {0.5, 0.5, 0.5, 0.3};
  std::vector<std::uint32_t> order;
  curve_order(positions, order);
  std::uint32_t last = 0;
  for (const auto k : order)
    if (k % 3 == 0) {
      EXPECT_GE(k, last);
      last = k;
    }
}

}  // namespace
}  // namespace acopla::dem::test
