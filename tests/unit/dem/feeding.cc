// How particles get into a scene: their sizes, their places, dense packings, inlets and outlets.
#include <gtest/gtest.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <set>

#include "dem/feeding/fill.h"
#include "dem/feeding/growth.h"
#include "dem/feeding/inlet.h"
#include "dem/feeding/read.h"

namespace acopla::dem::test {
namespace {

double sum_of(const std::vector<double>& values) { return std::accumulate(values.begin(), values.end(), 0.0); }

double solid(const std::vector<double>& radii, int dimension) {
  double volume = 0;
  for (const double radius : radii) volume += particle_volume(radius, dimension);
  return volume;
}

// Mean of d^power of a sample.
double moment(const std::vector<double>& radii, double power) {
  double sum = 0;
  for (const double radius : radii) sum += std::pow(2 * radius, power);
  return sum / static_cast<double>(radii.size());
}

// The least gap between any two particles, over the sum of their radii: by comparing all with all.
double least_gap(const std::vector<Vec3>& at, const std::vector<double>& radii) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < at.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) least = std::min(least, (at[i] - at[j]).norm() / (radii[i] + radii[j]) - 1);
  return least;
}

double least_gap(const std::vector<NewParticle>& particles) {
  std::vector<Vec3> at;
  std::vector<double> radii;
  for (const auto& particle : particles) {
    at.push_back(particle.at);
    radii.push_back(particle.radius);
  }
  return least_gap(at, radii);
}

// ---------------------------------------------------------------------------------------------------------------- random numbers

TEST(Random, GoesOnFromASavedState) {
  Random random(42);
  for (int k = 0; k < 100; ++k) random.normal();
  const auto saved = random.state();
  std::vector<double> first, again;
  for (int k = 0; k < 50; ++k) first.push_back(k % 2 ? random.uniform() : random.normal());
  Random other(7);
  other.restore(saved);
  for (int k = 0; k < 50; ++k) again.push_back(k % 2 ? other.uniform() : other.normal());
  EXPECT_EQ(first, again);
}

// The first three of SplitMix64 from state 1234567, as published with the reference implementation (Vigna 2015).
TEST(Random, IsSplitMix64) {
  Random random(1234567);
  EXPECT_EQ(random.bits(), 6457827717110365317ull);
  EXPECT_EQ(random.bits(), 3203168211198807973ull);
  EXPECT_EQ(random.bits(), 9817491932198370423ull);
}

// Standard errors of mean, variance and fourth moment of n normal deviates: sqrt(1/n), sqrt(2/n), sqrt(96/n); four of them.
TEST(Random, NormalDeviatesHaveTheirMoments) {
  Random random(3);
  constexpr double n = 200000;
  double mean = 0, square = 0, fourth = 0;
  for (int k = 0; k < n; ++k) {
    const double x = random.normal();
    mean += x / n;
    square += x * x / n;
    fourth += x * x * x * x / n;
  }
  EXPECT_NEAR(mean, 0, 4 * std::sqrt(1 / n));
  EXPECT_NEAR(square, 1, 4 * std::sqrt(2 / n));
  EXPECT_NEAR(fourth, 3, 4 * std::sqrt(96 / n));
}

// Each of the 24 orders of four is as likely: χ² of 23 degrees has mean 23 and deviation sqrt(46); five of them.
TEST(Random, PermutationsAreAllAsLikely) {
  Random random(11);
  std::map<std::vector<std::uint32_t>, int> seen;
  constexpr int n = 24000;
  for (int k = 0; k < n; ++k) ++seen[random.permutation(4)];
  ASSERT_EQ(seen.size(), 24u);
  double chi = 0;
  for (const auto& [order, times] : seen) chi += std::pow(times - n / 24.0, 2) / (n / 24.0);
  EXPECT_LT(chi, 23 + 5 * std::sqrt(46.0));
}

TEST(Random, StreamsOfASeedDiffer) {
  EXPECT_EQ(Random::stream(5, 0).bits(), Random(5).bits());
  std::set<std::uint64_t> first;
  for (std::uint64_t k = 0; k < 1000; ++k) first.insert(Random::stream(5, k).bits());
  EXPECT_EQ(first.size(), 1000u);
}

// --------------------------------------------------------------------------------------------------------------------------- sizes

// Nasato (2011), table 5-1: Tyler sieves 7 to 16. The next coarser sieve is 3.36 mm.
const std::vector<double> openings{3.36e-3, 2.80e-3, 2.38e-3, 2.00e-3, 1.68e-3, 1.40e-3, 1.19e-3, 1.00e-3};
const std::vector<double> percent{0.80, 19.67, 52.43, 22.80, 4.33, 0, 0};

SizeDistribution glass_beads(int dimension) {
  std::vector<SieveClass> classes;
  for (std::size_t k = 0; k < percent.size(); ++k) classes.push_back({openings[k + 1], openings[k], percent[k]});
  return SizeDistribution::sieved(classes, dimension);
}

std::vector<double> volume_by_sieve(const std::vector<double>& radii, int dimension) {
  std::vector<double> volumes(percent.size());
  for (const double radius : radii)
    for (std::size_t k = 0; k < percent.size(); ++k)
      if (2 * radius >= openings[k + 1] && (2 * radius < openings[k] || k == 0)) {
        volumes[k] += particle_volume(radius, dimension);
        break;
      }
  return volumes;
}

// One kilogram: the mass of each class is exact, but for a bead at the very opening, which does not occur. Round-off of the sum of
// about 10⁵ volumes.
TEST(Sizes, SieveMassesAreThoseOfTheTable) {
  for (const int dimension : {2, 3}) {
    const double volume = dimension == 3 ? 1.0 / 2487 : 0.05;
    Random random(1);
    const auto radii = glass_beads(dimension).draw_volume(volume, random);
    const auto volumes = volume_by_sieve(radii, dimension);
    for (std::size_t k = 0; k < percent.size(); ++k) EXPECT_NEAR(volumes[k], percent[k] / sum_of(percent) * volume, 1e-12 * volume) << k;
    EXPECT_NEAR(solid(radii, dimension), volume, 1e-12 * volume);
    EXPECT_NEAR(static_cast<double>(radii.size()), volume / glass_beads(dimension).mean_volume(), 3);  // half a particle a class
  }
}

// A small sample by number: a class of n particles reaches its share exactly when the mean that asks of them is within its sieves,
// else it is off by less than one of its largest.
TEST(Sizes, SieveMassesOfFewParticlesAreWithinOneOfThem) {
  for (const std::size_t count : {20u, 150u, 1000u}) {
    Random random(4);
    const auto radii = glass_beads(3).draw(count, random);
    ASSERT_EQ(radii.size(), count);
    const double volume = static_cast<double>(count) * glass_beads(3).mean_volume();
    const auto volumes = volume_by_sieve(radii, 3);
    for (std::size_t k = 0; k < percent.size(); ++k)
      EXPECT_NEAR(volumes[k], percent[k] / sum_of(percent) * volume, particle_volume(openings[k] / 2, 3)) << count << " " << k;
  }
}

// The law in a class: mass uniform in ln d, so that half of it is below the geometric mean of the openings. Ranks are stratified;
// the cumulative mass is off by one particle at most, and by what p ≠ 1 does, which is as much.
TEST(Sizes, WithinAClassTheMassIsUniformInTheLogarithmOfTheDiameter) {
  Random random(1);
  const auto radii = SizeDistribution::sieved({{0.01, 0.02, 1}}, 3).draw_volume(1, random);
  for (const double part : {0.25, 0.5, 0.75}) {
    const double below = 0.01 * std::pow(2, part);
    double volume = 0;
    for (const double radius : radii)
      if (2 * radius < below) volume += particle_volume(radius, 3);
    EXPECT_NEAR(volume, part, 2 * particle_volume(0.01, 3));
  }
}

// Gomes (2014), tables 3.5 and 4.2.
TEST(Sizes, GroupsHaveTheirCounts) {
  for (const std::size_t unit : {105u, 3750u}) {
    const auto sizes = SizeDistribution::groups({{0.0022, unit}, {0.002, 2 * unit}, {0.0018, unit}}, 2);
    EXPECT_EQ(sizes.own_count(), 4 * unit);
    Random random(1);
    std::map<double, std::size_t> counts;
    for (const double radius : sizes.draw(4 * unit, random)) ++counts[2 * radius];
    EXPECT_EQ(counts, (std::map<double, std::size_t>{{0.0022, unit}, {0.002, 2 * unit}, {0.0018, unit}}));
  }
}

TEST(Sizes, GroupsReachAMassWithinHalfOfTheirSmallest) {
  const auto sizes = SizeDistribution::groups({{0.013, 105}, {0.012, 210}, {0.011, 105}}, 2);
  for (const double volume : {0.0004, 0.01, 0.1234}) {
    Random random(1);
    EXPECT_NEAR(solid(sizes.draw_volume(volume, random), 2), volume, 0.5 * particle_volume(0.0055, 2) * (1 + 1e-9));
  }
}

double phi(double z) { return std::exp(-z * z / 2) / std::sqrt(2 * M_PI); }
double normal_below(double z) { return std::erfc(-z / std::sqrt(2.0)) / 2; }

// E d^k of a lognormal with its tails cut.
double cut_lognormal_moment(double k, double median, double deviation, double low, double high) {
  const double a = std::log(low / median) / deviation, b = std::log(high / median) / deviation;
  return std::pow(median, k) * std::exp(k * k * deviation * deviation / 2) *
         (normal_below(b - k * deviation) - normal_below(a - k * deviation)) / (normal_below(b) - normal_below(a));
}

// One particle in each n-th part of the law: a monotone function's mean is off by its range over n at most; 1e-7 of it is the table's.
void expect_moment(const std::vector<double>& radii, int power, double expected, double low, double high, const char* law) {
  const double range = std::pow(high, power) - std::pow(low, power);
  EXPECT_NEAR(moment(radii, power), expected, range * (1.0 / static_cast<double>(radii.size()) + 1e-7)) << law << " moment " << power;
}

TEST(Sizes, MomentsOfTheLawsByNumberMatchTheirClosedForms) {
  constexpr std::size_t n = 100000;
  const double a = 0.6, b = 1.7;
  Random random(8);
  auto radii = SizeDistribution::uniform(a, b, By::number, 3).draw(n, random);
  for (const int k : {1, 2, 3}) expect_moment(radii, k, (std::pow(b, k + 1) - std::pow(a, k + 1)) / ((k + 1) * (b - a)), a, b, "uniform");

  const double mean = 1.0, deviation = 0.3, alpha = (a - mean) / deviation, beta = (b - mean) / deviation;
  const double whole = normal_below(beta) - normal_below(alpha), shift = (phi(alpha) - phi(beta)) / whole;
  const double cut_mean = mean + deviation * shift;
  const double cut_variance = deviation * deviation * (1 + (alpha * phi(alpha) - beta * phi(beta)) / whole - shift * shift);
  radii = SizeDistribution::normal(mean, deviation, a, b, By::number, 3).draw(n, random);
  expect_moment(radii, 1, cut_mean, a, b, "normal");
  expect_moment(radii, 2, cut_variance + cut_mean * cut_mean, a, b, "normal");

  radii = SizeDistribution::lognormal(mean, deviation, a, b, By::number, 3).draw(n, random);
  for (const int k : {1, 2, 3}) expect_moment(radii, k, cut_lognormal_moment(k, mean, deviation, a, b), a, b, "lognormal");
}

// By mass the number goes with f(d)/d³ (d² for discs). Of a lognormal that is a lognormal again, with the median
// m exp(−3 s²) (Hatch & Choate 1929).
TEST(Sizes, MomentsOfTheLawsByMassMatchTheirClosedForms) {
  constexpr std::size_t n = 100000;
  const double a = 0.6, b = 1.7, mean = 1.0, deviation = 0.3;
  Random random(8);
  for (const int dimension : {2, 3}) {
    auto radii = SizeDistribution::lognormal(mean, deviation, a, b, By::mass, dimension).draw(n, random);
    for (const int k : {1, 2, 3})
      expect_moment(radii, k, cut_lognormal_moment(k, mean * std::exp(-dimension * deviation * deviation), deviation, a, b), a, b,
                    "lognormal");
    radii = SizeDistribution::uniform(a, b, By::mass, dimension).draw(n, random);
    const auto integral = [&](double k) { return k == -1 ? std::log(b / a) : (std::pow(b, k + 1) - std::pow(a, k + 1)) / (k + 1); };
    for (const int k : {1, 2, 3}) expect_moment(radii, k, integral(k - dimension) / integral(-dimension), a, b, "uniform");
    // The mean diameter by mass, Σ d d³ / Σ d³, is the cut normal's.
    radii = SizeDistribution::normal(mean, deviation, a, b, By::mass, dimension).draw(n, random);
    const double alpha = (a - mean) / deviation, beta = (b - mean) / deviation;
    const double expected = mean + deviation * (phi(alpha) - phi(beta)) / (normal_below(beta) - normal_below(alpha));
    const double range = std::pow(b, dimension + 1) / std::pow(a, dimension);
    EXPECT_NEAR(moment(radii, dimension + 1) / moment(radii, dimension), expected, 2 * range * (1.0 / n + 1e-7));
  }
}

TEST(Sizes, MeanVolumeIsThatOfTheSample) {
  Random random(2);
  for (const auto& sizes : {SizeDistribution::lognormal(1, 0.4, 0.3, 3.3, By::number, 3), glass_beads(3), glass_beads(2)}) {
    const auto radii = sizes.draw(200000, random);
    EXPECT_NEAR(solid(radii, sizes.dimension()) / 200000, sizes.mean_volume(),
                2 * particle_volume(sizes.largest_radius(), sizes.dimension()) / 200000);
  }
}

TEST(Sizes, AVolumeIsMetExactlyWhereDiametersVary) {
  Random random(2);
  for (const double volume : {5.0, 40.0, 4000.0}) {
    const auto radii = SizeDistribution::normal(1, 0.2, 0.4, 1.6, By::number, 3).draw_volume(volume, random);
    EXPECT_NEAR(solid(radii, 3), volume, 1e-12 * volume);
    for (const double radius : radii) EXPECT_TRUE(radius >= 0.2 && radius <= 0.8);
  }
  EXPECT_NEAR(solid(SizeDistribution::one(1, 3).draw_volume(100, random), 3), 100, 0.5 * particle_volume(0.5, 3));
}

TEST(Sizes, SeedDecidesTheSampleAndItsOrder) {
  Random a(5), b(5), c(6);
  const auto first = glass_beads(3).draw(1000, a), again = glass_beads(3).draw(1000, b), other = glass_beads(3).draw(1000, c);
  EXPECT_EQ(first, again);
  EXPECT_NE(first, other);
  EXPECT_FALSE(std::is_sorted(first.begin(), first.end()) || std::is_sorted(first.rbegin(), first.rend()));
}

// At any time, no group is more than one particle off its share.
TEST(Sizes, AFeedKeepsTheSharesAllTheTime) {
  const auto sizes = SizeDistribution::groups({{0.013, 1}, {0.012, 2}, {0.011, 1}}, 3);
  Random random(1);
  std::vector<double> delivered;
  std::map<double, double> counts{{0.013, 0}, {0.012, 0}, {0.011, 0}};
  for (int n = 1; n <= 2000; ++n) {
    ++counts.at(2 * sizes.draw_next(delivered, random));
    for (const auto& [diameter, count] : counts) ASSERT_LE(std::abs(count - n * (diameter == 0.012 ? 0.5 : 0.25)), 1) << n;
  }
}

// ------------------------------------------------------------------------------------------------------------------------- regions

std::vector<Region> all_regions() {
  return {Region::box({0, -1, 0}, {2, 1, 0.5}, 3), Region::ball({1, 2, 3}, 0.8, 3), Region::cylinder({0, 0, 0}, {1, 2, -1}, 0.5),
          Region::box({0, -1, 0}, {2, 1, 0}, 2), Region::ball({1, 2, 0}, 0.8, 2)};
}

TEST(Regions, VolumesAreThoseOfTheShapes) {
  const double expected[] = {2, 4.0 / 3 * M_PI * 0.512, M_PI * 0.25 * std::sqrt(6.0), 4, M_PI * 0.64};
  const auto regions = all_regions();
  for (std::size_t k = 0; k < regions.size(); ++k) EXPECT_NEAR(regions[k].volume(), expected[k], 1e-14) << regions[k].text();
}

// The part of the points of the bounding box that is inside is the ratio of volumes: four standard errors of a binomial. It would
// also notice bounds that cut something off, or, with the next test, a shape and a volume that differ.
TEST(Regions, ContainWhatTheirVolumeSays) {
  constexpr int n = 100000;
  Random random(1);
  for (const auto& region : all_regions()) {
    const auto bounds = region.bounds();
    const auto around = Region::box(bounds.low, bounds.high, region.dimension());
    int inside = 0;
    for (int k = 0; k < n; ++k) inside += region.contains(around.random_point(random));
    const double part = region.volume() / around.volume();
    EXPECT_NEAR(static_cast<double>(inside) / n, part, 4 * std::sqrt(part * (1 - part) / n) + 1e-12) << region.text();
  }
}

// All of many points are within the bounds, and some come near each side: the region's part within 0.05 of a side is at least 3e-4 of
// it (a cap of the cylinder's rim), so that none of 10⁵ points falls there once in e^30.
TEST(Regions, BoundsAreTight) {
  Random random(8);
  for (const auto& region : all_regions()) {
    const auto bounds = region.bounds();
    Vec3 low = Vec3::Constant(1e9), high = -low;
    for (int k = 0; k < 100000; ++k) {
      const Vec3 at = region.random_point(random);
      low = low.cwiseMin(at);
      high = high.cwiseMax(at);
    }
    for (int d = 0; d < region.dimension(); ++d) {
      EXPECT_GE(low[d], bounds.low[d] - 1e-12) << region.text();
      EXPECT_LE(high[d], bounds.high[d] + 1e-12) << region.text();
      EXPECT_LT(low[d], bounds.low[d] + 0.05) << region.text();
      EXPECT_GT(high[d], bounds.high[d] - 0.05) << region.text();
    }
  }
}

// Centres of whole particles, uniform over the region shrunk by the radius: mean and mean square distance from the centre against
// the integrals over the shape; four standard errors, bounded by those of the square's largest value.
TEST(Regions, RandomPointsAreUniformAndInside) {
  constexpr int n = 40000;
  const double radius = 0.1;
  // ∫ |x − c|² dV / V of the shrunk shapes.
  const double square[] = {(1.8 * 1.8 + 1.8 * 1.8 + 0.3 * 0.3) / 12, 0.6 * 0.7 * 0.7,
                           0.5 * 0.4 * 0.4 + std::pow(std::sqrt(6.0) - 0.2, 2) / 12, (1.8 * 1.8 + 1.8 * 1.8) / 12, 0.5 * 0.7 * 0.7};
  const auto regions = all_regions();
  Random random(3);
  for (std::size_t k = 0; k < regions.size(); ++k) {
    Vec3 mean = Vec3::Zero();
    double spread = 0, farthest = 0;
    for (int i = 0; i < n; ++i) {
      const Vec3 at = regions[k].random_point(random, radius);
      ASSERT_TRUE(regions[k].contains(at, radius * (1 - 1e-12)));
      mean += (at - regions[k].centre()) / n;
      spread += (at - regions[k].centre()).squaredNorm() / n;
      farthest = std::max(farthest, (at - regions[k].centre()).squaredNorm());
    }
    EXPECT_LT(mean.norm(), 4 * std::sqrt(square[k] / n)) << regions[k].text();
    EXPECT_NEAR(spread, square[k], 4 * 0.5 * farthest / std::sqrt(n)) << regions[k].text();
  }
}

TEST(Regions, DistanceFromTheirFacesIsTheLargestParticleThatFitsThere) {
  Random random(6);
  for (const auto& region : all_regions())
    for (int k = 0; k < 200; ++k) {
      const Vec3 at = region.random_point(random);
      double room = std::numeric_limits<double>::infinity();
      for (const auto& face : region.faces(at)) {
        EXPECT_NEAR(face.inward.norm(), 1, 1e-14);
        room = std::min(room, face.distance);
        // A step inward is a step away from that face.
        for (const auto& moved : region.faces(at + 1e-3 * face.inward))
          if ((moved.inward - face.inward).norm() < 1e-6) {
            EXPECT_NEAR(moved.distance, face.distance + 1e-3, 1e-12);
          }
      }
      EXPECT_TRUE(region.contains(at, room * (1 - 1e-12)));
      EXPECT_FALSE(region.contains(at, room + 1e-9));
    }
}

// ----------------------------------------------------------------------------------------------------------------- random placing

TEST(Occupancy, AgreesWithComparingAllOverAHundredfoldRangeOfSizes) {
  Random random(2);
  for (const int dimension : {2, 3}) {
    const auto region = Region::box({-1, -1, -1}, {1, 1, 1}, dimension);
    std::vector<Vec3> at;
    std::vector<double> radii;
    Occupancy occupancy(dimension, 0.2);
    int free = 0;
    for (int k = 0; k < 3000; ++k) {
      const Vec3 here = region.random_point(random);
      const double radius = 0.2 * std::pow(100, -random.uniform());
      bool expected = true;
      for (std::size_t i = 0; i < at.size(); ++i) expected = expected && (here - at[i]).norm() >= radius + radii[i];
      ASSERT_EQ(occupancy.is_free(here, radius), expected) << k;
      if (!expected) continue;
      ++free;
      at.push_back(here);
      radii.push_back(radius);
      occupancy.add(here, radius);
    }
    EXPECT_GT(free, 100);
  }
}

Filling filling_of(SizeDistribution sizes, Region region, std::size_t count) {
  Filling filling;
  filling.name = "g.insert[0]";
  filling.density = 1000;
  filling.sizes = std::move(sizes);
  filling.region = std::move(region);
  filling.count = count;
  return filling;
}

TEST(RandomPlacing, ParticlesOfAnySizesAreInsideAndDoNotOverlap) {
  for (const auto& region : all_regions()) {
    const int dimension = region.dimension();
    const auto particles =
        fill(std::vector{filling_of(SizeDistribution::lognormal(0.03, 0.5, 0.01, 0.2, By::number, dimension), region, 600)},
             {.dimension = dimension});
    ASSERT_EQ(particles.size(), 600u);
    EXPECT_GE(least_gap(particles), 0);
    for (const auto& particle : particles) {
      EXPECT_TRUE(region.contains(particle.at, particle.radius * (1 - 1e-12)));
      if (dimension == 2) {
        EXPECT_EQ(particle.at[2], 0);
      }
    }
  }
}

// The small ones come second: with them first, the large ones would find no hole.
TEST(RandomPlacing, LargerParticlesFindTheirPlaceFirst) {
  const auto sizes = SizeDistribution::groups({{0.02, 8000}, {0.3, 4}}, 3);
  const auto particles = fill(std::vector{filling_of(sizes, Region::box({0, 0, 0}, {1, 1, 1}, 3), 8004)}, {});
  EXPECT_EQ(particles.size(), 8004u);
  EXPECT_EQ(std::count_if(particles.begin(), particles.end(), [](const auto& one) { return one.radius == 0.15; }), 4);
}

TEST(RandomPlacing, KeepsClearOfWhatIsNotVacant) {
  const auto vacant = [](const Vec3& at, double radius) { return std::abs(at[0] - 0.5) > 0.1 + radius; };
  const auto particles = fill(std::vector{filling_of(SizeDistribution::one(0.04, 3), Region::box({0, 0, 0}, {1, 1, 1}, 3), 500)},
                              {.dimension = 3, .gravity = Vec3::Zero(), .seed = 1, .vacant = vacant});
  for (const auto& particle : particles) EXPECT_GT(std::abs(particle.at[0] - 0.5), 0.12);
}

TEST(RandomPlacing, AFillingIsTheSameWhateverComesAfterIt) {
  const auto box = Region::box({0, 0, 0}, {1, 1, 1}, 3), other = Region::box({2, 0, 0}, {3, 1, 1}, 3);
  const auto one = filling_of(SizeDistribution::uniform(0.03, 0.06, By::number, 3), box, 200);
  const auto alone = fill(std::vector{one}, {}), again = fill(std::vector{one}, {});
  const auto both = fill(std::vector{one, filling_of(SizeDistribution::one(0.05, 3), other, 100)}, {});
  const auto reseeded = fill(std::vector{one}, {.dimension = 3, .gravity = Vec3::Zero(), .seed = 2, .vacant = {}});
  ASSERT_EQ(both.size(), 300u);
  for (std::size_t k = 0; k < 200; ++k) {
    EXPECT_EQ(alone[k].at, again[k].at);
    EXPECT_EQ(alone[k].at, both[k].at);
    EXPECT_EQ(alone[k].radius, both[k].radius);
    EXPECT_NE(alone[k].at, reseeded[k].at);
  }
  EXPECT_GE(least_gap(both), 0);
}

// ------------------------------------------------------------------------------------------------------------------------ lattices

// Neighbours at the spacing of an inner site, and how many sites there are within √2 + and √(8/3) +.
struct Shells {
  LatticeKind kind;
  int dimension, nearest, second, third;
};

TEST(Lattices, CoordinationIsThatOfTheCrystal) {
  // Distances in units of the spacing. square: 1 (4), √2 (4). hexagonal: 1 (6), √3 (6). cubic: 1 (6), √2 (12), √3 (8).
  // fcc: 1 (12), √2 (6), √3 (24). hcp: 1 (12), √2 (6), √(8/3) (2), √3 (18).
  for (const auto& [kind, dimension, nearest, second, third] : {Shells{LatticeKind::square, 2, 4, 8, 8},
                                                                {LatticeKind::hexagonal, 2, 6, 6, 6},
                                                                {LatticeKind::cubic, 3, 6, 18, 18},
                                                                {LatticeKind::fcc, 3, 12, 18, 18},
                                                                {LatticeKind::hcp, 3, 12, 18, 20}}) {
    for (const Vec3& gravity : {Vec3(0, -1, 0), Vec3(1, 0, 0), Vec3(0, 0, -1)}) {
      const auto sites = lattice_sites(Region::box({0, 0, 0}, {1, 1, 1}, dimension), {kind, 0.1, 0}, 0.05, gravity, {}, 0);
      const auto inner = std::min_element(sites.begin(), sites.end(), [&](const Vec3& a, const Vec3& b) {
        const Vec3 middle(0.5, 0.5, dimension == 3 ? 0.5 : 0);
        return (a - middle).norm() < (b - middle).norm();
      });
      double least = 1;
      int counted[3] = {};
      for (const auto& site : sites) {
        const double distance = (site - *inner).norm() / 0.1;
        if (distance < 1e-9) continue;
        least = std::min(least, distance);
        counted[0] += distance < 1.001;
        counted[1] += distance < 1.415;
        counted[2] += distance < 1.634;
      }
      EXPECT_NEAR(least, 1, 1e-9);
      EXPECT_EQ(counted[0], nearest);
      EXPECT_EQ(counted[1], second);
      EXPECT_EQ(counted[2], third);
    }
  }
}

TEST(Lattices, ExactFitLosesNoRow) {
  EXPECT_EQ(lattice_sites(Region::box({0, 0, 0}, {1, 0.7, 0.3}, 3), {LatticeKind::cubic, 0.1, 0}, 0.05, Vec3::Zero(), {}, 0).size(), 210u);
  EXPECT_EQ(lattice_sites(Region::box({0.3, 0, 0}, {1.3, 0.7, 0}, 2), {LatticeKind::square, 0.1, 0}, 0.05, Vec3::Zero(), {}, 0).size(),
            70u);
  // Rows of 10 and 9 in turn; 1 + floor((1 − 0.1)/(0.1 √3/2)) = 11 of them.
  EXPECT_EQ(lattice_sites(Region::box({0, 0, 0}, {1, 1, 0}, 2), {LatticeKind::hexagonal, 0.1, 0}, 0.05, Vec3::Zero(), {}, 0).size(), 105u);
}

TEST(Lattices, GrowFromTheSideThatGravityPointsTo) {
  for (int axis = 0; axis < 3; ++axis)
    for (const double sign : {-1.0, 1.0}) {
      const auto sites =
          lattice_sites(Region::box({0, 0, 0}, {1, 1, 1}, 3), {LatticeKind::cubic, 0.1, 0}, 0.05, 9.81 * sign * Vec3::Unit(axis), {}, 250);
      ASSERT_EQ(sites.size(), 250u);  // two and a half layers of 100
      for (const auto& site : sites) EXPECT_LT(sign < 0 ? site[axis] : 1 - site[axis], 0.26);
    }
}

TEST(Lattices, JitterMovesParticlesButNeverIntoEachOtherOrOut) {
  for (const auto& region : all_regions()) {
    const int dimension = region.dimension();
    auto filling = filling_of(SizeDistribution::uniform(0.05, 0.1, By::number, dimension), region, 1);
    filling.count.reset();
    filling.placing = Placing::lattice;
    for (const auto kind : dimension == 2 ? std::vector{LatticeKind::square, LatticeKind::hexagonal}
                                          : std::vector{LatticeKind::cubic, LatticeKind::fcc, LatticeKind::hcp}) {
      filling.lattice = {kind, 0.11, 0};
      const auto still = fill(std::vector{filling}, {.dimension = dimension});
      filling.lattice.jitter = 1;
      const auto moved = fill(std::vector{filling}, {.dimension = dimension});
      ASSERT_GT(still.size(), 50u);
      ASSERT_EQ(still.size(), moved.size());
      EXPECT_GE(least_gap(moved), 0);
      double travel = 0;
      for (std::size_t k = 0; k < moved.size(); ++k) {
        EXPECT_TRUE(region.contains(moved[k].at, moved[k].radius * (1 - 1e-9)));
        EXPECT_LE((moved[k].at - still[k].at).norm(), 0.055 - moved[k].radius + 1e-12);
        travel += (moved[k].at - still[k].at).norm() / static_cast<double>(moved.size());
      }
      EXPECT_GT(travel, 0.005);
      EXPECT_EQ(radii_of(filling, 0, {.dimension = dimension}).size(), moved.size());
    }
  }
}

// -------------------------------------------------------------------------------------------------------------------------- growth

std::vector<double> scaled_to(std::vector<double> radii, double fraction, const Region& region) {
  const double scale = std::pow(fraction * region.volume() / solid(radii, region.dimension()), 1.0 / region.dimension());
  for (auto& radius : radii) radius *= scale;
  return radii;
}

// Whatever the sizes and the region: no overlap at all, the radii untouched, the fraction that was asked for.
TEST(Growth, PacksToTheTargetWithoutAnyOverlap) {
  Random random(1);
  struct Packed {
    Region region;
    double fraction;
    std::size_t count;
    double ratio;  // of the largest to the smallest
  };
  for (const auto& [region, fraction, count, ratio] :
       {Packed{Region::box({0, 0, 0}, {1, 1, 0}, 2), 0.82, 1000, 1}, Packed{Region::box({0, 0, 0}, {2, 1, 0}, 2), 0.82, 1000, 2},
        Packed{Region::ball({3, 0, 0}, 1, 2), 0.78, 800, 1}, Packed{Region::box({0, 0, 0}, {1, 1, 1}, 3), 0.58, 1000, 1},
        Packed{Region::box({-1, 0, 0}, {1, 1, 1}, 3), 0.60, 1500, 3}, Packed{Region::ball({0, 0, 7}, 1, 3), 0.55, 800, 1},
        Packed{Region::cylinder({0, 0, 0}, {1, 1, 1}, 0.5), 0.55, 800, 1}, Packed{Region::box({0, 0, 0}, {1, 1, 1}, 3), 0.1, 5, 1}}) {
    const auto sizes =
        ratio > 1 ? SizeDistribution::uniform(1, ratio, By::mass, region.dimension()) : SizeDistribution::one(1, region.dimension());
    const auto radii = scaled_to(sizes.draw(count, random), fraction, region);
    const auto packing = grow_packing(region, radii, random);
    ASSERT_FALSE(packing.jammed) << region.text() << " " << packing.solid_fraction;
    ASSERT_EQ(packing.at.size(), radii.size());
    EXPECT_GE(least_gap(packing.at, radii), 0) << region.text();
    for (std::size_t k = 0; k < radii.size(); ++k) ASSERT_TRUE(region.contains(packing.at[k], radii[k])) << region.text();
    EXPECT_NEAR(packing.solid_fraction, fraction, 1e-12);
    EXPECT_NEAR(solid(radii, region.dimension()) / region.volume(), fraction, 1e-12);
  }
}

// Slow to reach by random starts alone; 14 diameters across.
TEST(Growth, EqualSpheresReach62PerCent) {
  const auto region = Region::box({0, 0, 0}, {1, 1, 1}, 3);
  const auto radii = scaled_to(std::vector<double>(3500, 1.0), 0.62, region);
  Random random(1);
  const auto packing = grow_packing(region, radii, random);
  EXPECT_FALSE(packing.jammed) << packing.solid_fraction;
  EXPECT_GE(least_gap(packing.at, radii), 0);
}

// The contact network prefers no direction: fabric ⟨n n⟩ of the near pairs away from the walls is I/D. Over N independent
// directions its components vary by sqrt(4/45/N) in 3D (diagonal) and sqrt(1/8/N) in 2D; four of them. Sizes are spread so that no
// crystal forms.
TEST(Growth, PackingsAreIsotropic) {
  for (const int dimension : {2, 3}) {
    const auto region = Region::box({0, 0, 0}, {1, 1, 1}, dimension);
    Random random(9);
    const auto radii =
        scaled_to(SizeDistribution::uniform(1, 2, By::number, dimension).draw(2000, random), dimension == 2 ? 0.81 : 0.6, region);
    const auto packing = grow_packing(region, radii, random);
    ASSERT_FALSE(packing.jammed);
    const double largest = *std::max_element(radii.begin(), radii.end());
    Eigen::Matrix3d fabric = Eigen::Matrix3d::Zero();
    double pairs = 0;
    for (std::size_t i = 0; i < radii.size(); ++i) {
      if (!region.contains(packing.at[i], 4 * largest)) continue;
      for (std::size_t j = 0; j < i; ++j) {
        const Vec3 way = packing.at[i] - packing.at[j];
        if (way.norm() > 1.02 * (radii[i] + radii[j])) continue;
        fabric += way.normalized() * way.normalized().transpose();
        ++pairs;
      }
    }
    ASSERT_GT(pairs, 500);
    fabric /= pairs;
    const double error = dimension == 2 ? std::sqrt(1.0 / 8 / pairs) : std::sqrt(4.0 / 45 / pairs);
    for (int a = 0; a < dimension; ++a)
      for (int b = 0; b < dimension; ++b) EXPECT_NEAR(fabric(a, b), a == b ? 1.0 / dimension : 0, 4 * error) << dimension;
  }
}

// In a ball nothing tells one direction from another. Of N independent points in it the centre of mass would vary by R/sqrt(5 N) in
// each direction (R/2/sqrt(N) in a disc), and the moments ⟨x_a x_b⟩ by less than R²/2/sqrt(N); a dense packing varies less.
TEST(Growth, PackingsInABallAreCentredAndRound) {
  for (const int dimension : {2, 3}) {
    const auto region = Region::ball(Vec3(1, 1, dimension == 3 ? 1 : 0), 1, dimension);
    const std::size_t count = 1500;
    const auto radii = scaled_to(std::vector<double>(count, 1.0), dimension == 2 ? 0.75 : 0.5, region);
    Random random(2);
    const auto packing = grow_packing(region, radii, random);
    ASSERT_FALSE(packing.jammed);
    Vec3 mean = Vec3::Zero();
    Eigen::Matrix3d second = Eigen::Matrix3d::Zero();
    for (const auto& at : packing.at) {
      const Vec3 x = at - region.centre();
      mean += x / static_cast<double>(count);
      second += x * x.transpose() / static_cast<double>(count);
    }
    EXPECT_LT(mean.norm(), 3 * std::sqrt((dimension == 2 ? 2 * 0.25 : 3 * 0.2) / static_cast<double>(count)));
    const double even = second.trace() / dimension, error = 0.5 / std::sqrt(static_cast<double>(count));
    for (int a = 0; a < dimension; ++a)
      for (int b = 0; b < dimension; ++b) EXPECT_NEAR(second(a, b), a == b ? even : 0, 3 * error) << dimension;
  }
}

TEST(Growth, IsTheSameForTheSameSeed) {
  const auto region = Region::box({0, 0, 0}, {1, 1, 1}, 3);
  const auto radii = scaled_to(std::vector<double>(300, 1.0), 0.5, region);
  Random a(3), b(3), c(4);
  const auto first = grow_packing(region, radii, a), again = grow_packing(region, radii, b), other = grow_packing(region, radii, c);
  EXPECT_EQ(first.at, again.at);
  EXPECT_NE(first.at, other.at);
}

// What is reported as reached was reached: the packing at the radii scaled to it has no overlap, and random close packing is above.
TEST(Growth, BeyondRandomClosePackingItSaysWhatIsReached) {
  for (const int dimension : {2, 3}) {
    const auto region = Region::box({0, 0, 0}, {1, 1, 1}, dimension);
    const auto radii = scaled_to(std::vector<double>(500, 1.0), dimension == 2 ? 0.95 : 0.75, region);
    Random random(1);
    const auto packing = grow_packing(region, radii, random);
    EXPECT_TRUE(packing.jammed);
    EXPECT_GT(packing.solid_fraction, dimension == 2 ? 0.80 : 0.55);
    EXPECT_LT(packing.solid_fraction, dimension == 2 ? 0.9069 : 0.66);
    EXPECT_GE(least_gap(packing.at, scaled_to(radii, packing.solid_fraction, region)), 0);
  }
}

// -------------------------------------------------------------------------------------------------------------------------- inlets

Inlet stream_of(const SizeDistribution& sizes, double rate) {
  return {"g.inlet[0]", 0, 2500, rate, 0.2, 1.2, sizes, Region::box({0, 0, 0}, {1, 1, 0.3}, 3), Vec3(0, 0, -1), Vec3::Zero(), 3, {}};
}

TEST(Inlets, DeliveredMassFollowsTheRateToHalfAParticle) {
  InletFeed feed(stream_of(SizeDistribution::uniform(0.02, 0.05, By::number, 3), 80));
  const double half = 0.5 * 2500 * particle_volume(0.025, 3);
  double mass = 0;
  std::uint64_t count = 0;
  for (double time = 0; time < 1.5; time += 0.0137) {
    const auto particles = feed.due(time, [](const Vec3&, double) { return true; });
    for (const auto& particle : particles) {
      mass += 2500 * particle_volume(particle.radius, 3);
      EXPECT_TRUE(feed.inlet().region.contains(particle.at, particle.radius * (1 - 1e-12)));
      EXPECT_EQ(particle.velocity, Vec3(0, 0, -1));
    }
    EXPECT_GE(least_gap(particles), 0);
    count += particles.size();
    EXPECT_NEAR(mass, 80 * std::clamp(time - 0.2, 0.0, 1.0), half * (1 + 1e-9)) << time;
    EXPECT_NEAR(feed.state().delivered, mass, 1e-12 * 80);
    EXPECT_EQ(feed.state().count, count);
  }
  EXPECT_GT(count, 800u);
  EXPECT_EQ(feed.state().refusals, 0u);
  EXPECT_FALSE(feed.warning());
}

// A region that is full half of the time: nothing overlaps what is there, the mass waits and is all delivered after all.
TEST(Inlets, AChokedInletSaysSoAndLosesNoMass) {
  InletFeed feed(stream_of(SizeDistribution::one(0.05, 3), 40));
  const double one = 2500 * particle_volume(0.025, 3);
  const auto blocked = [](const Vec3&, double) { return false; };
  const auto open = [](const Vec3&, double) { return true; };
  std::size_t count = feed.due(0.5, open).size();
  EXPECT_FALSE(feed.choked());
  EXPECT_EQ(feed.due(0.8, blocked).size(), 0u);
  EXPECT_EQ(feed.due(0.9, blocked).size(), 0u);
  EXPECT_TRUE(feed.choked());
  EXPECT_EQ(feed.state().refusals, 2u);
  EXPECT_NEAR(feed.backlog(), 40 * 0.4, one / 2 * (1 + 1e-9));
  ASSERT_TRUE(feed.warning());
  EXPECT_NE(feed.warning()->find("g.inlet[0] is choked since 0.8 s"), std::string::npos) << *feed.warning();
  for (const double time : {1.0, 1.2, 1.3}) count += feed.due(time, open).size();
  EXPECT_FALSE(feed.choked());
  EXPECT_FALSE(feed.warning());
  EXPECT_NEAR(static_cast<double>(count) * one, 40, one / 2 * (1 + 1e-9));
  EXPECT_NEAR(feed.state().largest_backlog, 40 * 0.4, one / 2 * (1 + 1e-9));
}

// More than the region holds at once: what fits comes, without overlap; the rest later.
TEST(Inlets, ARegionThatIsFullTakesTheRestLater) {
  auto inlet = stream_of(SizeDistribution::one(0.1, 3), 1000);
  InletFeed feed(inlet);
  Occupancy there(3, 0.05);
  const auto vacant = [&](const Vec3& at, double radius) { return there.is_free(at, radius); };
  std::vector<NewParticle> all;
  for (int k = 0; k < 3; ++k)
    for (const auto& particle : feed.due(1.2 + 0.1 * k, vacant)) {
      there.add(particle.at, particle.radius);
      all.push_back(particle);
    }
  EXPECT_TRUE(feed.choked());
  EXPECT_GE(least_gap(all), 0);
  EXPECT_NEAR(feed.backlog() + static_cast<double>(all.size()) * 2500 * particle_volume(0.05, 3), 1000, 1e-9);
}

TEST(Inlets, GoOnFromASavedStateAsIfNothingHadHappened) {
  const auto inlet = stream_of(glass_beads(3), 0.01);
  const auto vacant = [](const Vec3& at, double) { return at[0] > 0.3; };
  InletFeed feed(inlet), restarted(inlet);
  for (double time = 0; time < 0.6; time += 0.01) feed.due(time, vacant);
  const InletState saved = feed.state();
  restarted.due(0.9, vacant);
  restarted.restore(saved);
  for (double time = 0.6; time < 1.3; time += 0.01) {
    const auto a = feed.due(time, vacant), b = restarted.due(time, vacant);
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t k = 0; k < a.size(); ++k) {
      EXPECT_EQ(a[k].at, b[k].at);
      EXPECT_EQ(a[k].radius, b[k].radius);
    }
  }
  EXPECT_EQ(feed.state(), restarted.state());
  EXPECT_GT(feed.state().count, saved.count);
}

// In every class within two of its largest beads of its share: one by the divisors, one because a class is weighed by its mean bead.
TEST(Inlets, KeepTheSieveCurve) {
  InletFeed feed(stream_of(glass_beads(3), 0.05));
  std::vector<double> radii;
  for (double time = 0; time < 1.3; time += 0.05)
    for (const auto& particle : feed.due(time, {})) radii.push_back(particle.radius);
  const auto volumes = volume_by_sieve(radii, 3);
  for (std::size_t k = 0; k < percent.size(); ++k)
    EXPECT_NEAR(volumes[k], percent[k] / sum_of(percent) * solid(radii, 3), 2 * particle_volume(openings[k] / 2, 3)) << k;
}

TEST(Outlets, CountWhatLeaves) {
  Outlet outlet{"drain", Region::ball({0, 0, 0}, 1, 3)};
  const std::vector<Vec3> at{{0, 0, 0}, {2, 0, 0}, {0.5, 0.5, 0.5}, {0.9, 0.9, 0}};
  const auto gone = outlet.leaving(
      at.size(), [&](std::size_t k) { return at[k]; }, [](std::size_t k) { return std::pow(2.0, static_cast<double>(k)); });
  EXPECT_EQ(gone, (std::vector<std::uint32_t>{0, 2}));
  EXPECT_EQ(outlet.mass, 5);
  EXPECT_EQ(outlet.count, 2u);
}

// ------------------------------------------------------------------------------------------------------------------------- reading

const FeedingScope space{3, {"glass", "steel"}, {2500, 7800}, 1}, plane_scope{2, {"glass", "steel"}, {2500, 7800}, 1};

// Reads [[g.insert]], [[g.inlet]] and [[g.outlet]] of a text, and places what they insert.
std::vector<NewParticle> feed(const std::string& text, const FeedingScope& scope, std::vector<Filling>* fillings = nullptr) {
  const auto root = io::Table::from_text(text, "case.toml");
  const auto table = root.table("g");
  std::vector<Filling> read;
  for (const auto& entry : table.list("insert")) read.push_back(read_filling(entry, scope));
  std::size_t inlets = 0;
  for (const auto& entry : table.list("inlet")) InletFeed(read_inlet(entry, scope, inlets++)).due(1, {});
  for (const auto& entry : table.list("outlet")) read_outlet(entry, scope);
  table.reject_unknown();
  if (fillings) *fillings = read;
  return read.empty() ? std::vector<NewParticle>{}
                      : fill(read, {.dimension = scope.dimension, .gravity = Vec3(0, 0, -9.81), .seed = 1, .vacant = {}});
}

std::string insert(const std::string& lines) { return "[[g.insert]]\nmaterial = \"glass\"\n" + lines; }

TEST(ReadFeeding, EverySizeLawAndAmountGivesItsParticles) {
  const std::string box = "region = { box = [[0, 0, 0], [1, 1, 1]] }\n";
  EXPECT_EQ(feed(insert("diameter = 0.05\ncount = 100\n" + box), space).size(), 100u);
  // 12.5 kg of 2500 kg/m³ are 76.39 spheres of 5 cm.
  EXPECT_EQ(feed(insert("diameter = 0.05\nmass = 12.5\n" + box), space).size(), 76u);
  EXPECT_EQ(feed(insert("diameter = 0.05\nsolid_fraction = 0.1\n" + box), space).size(), 1528u);
  EXPECT_EQ(feed(insert("sizes = { groups = [{ diameter = 0.05, count = 30 }, { diameter = 0.1, count = 5 }] }\n" + box), space).size(),
            35u);
  for (const std::string law :
       {"uniform = [0.03, 0.06]", "uniform = [0.03, 0.06], by = \"mass\"", "normal = { mean = 0.05, deviation = 0.01 }",
        "lognormal = { median = 0.05, deviation = 0.2, limits = [0.03, 0.08] }",
        "sieve = { openings = [0.06, 0.04, 0.03], retained = [10, 60, 30], largest = 0.07 }",
        "sieve = { openings = [0.06, 0.04, 0.03], passing = [90, 30, 0], largest = 0.07 }",
        "sieve = { openings = [0.06, 0.04], retained = [10, 60, 30], largest = 0.07, smallest = 0.03 }"}) {
    double mass = 0;
    for (const auto& particle : feed(insert("sizes = { " + law + " }\nmass = 30\n" + box), space))
      mass += 2500 * particle_volume(particle.radius, 3);
    EXPECT_NEAR(mass, 30, 1e-10) << law;
  }
}

// Retained and passing say the same of the same sample.
TEST(ReadFeeding, RetainedAndPassingAreTheSameCurve) {
  const auto with = [](const std::string& curve) {
    return feed(insert("count = 500\nregion = { box = [[0, 0, 0], [1, 1, 1]] }\nsizes = { sieve = { openings = [0.06, 0.04, 0.03], " +
                       curve + ", largest = 0.07 } }\n"),
                space);
  };
  const auto retained = with("retained = [10, 60, 30]"), passing = with("passing = [90, 30, 0]");
  for (std::size_t k = 0; k < 500; ++k) EXPECT_EQ(retained[k].radius, passing[k].radius);
}

TEST(ReadFeeding, GivenParticlesAreTakenAsTheyAre) {
  const auto particles =
      feed(insert("particles = [{ at = [1, 2, 3], diameter = 0.5, velocity = [0, 0, -1], spin = [4, 5, 6] }, { at = [1, 2, 3.4], "
                  "diameter = 0.5 }]"),
           space);
  ASSERT_EQ(particles.size(), 2u);
  EXPECT_EQ(particles[0].at, Vec3(1, 2, 3));
  EXPECT_EQ(particles[0].radius, 0.25);
  EXPECT_EQ(particles[0].velocity, Vec3(0, 0, -1));
  EXPECT_EQ(particles[0].spin, Vec3(4, 5, 6));
  EXPECT_EQ(particles[1].velocity, Vec3::Zero());
  const auto disc = feed(insert("particles = [{ at = [1, 2], diameter = 0.5, spin = 7 }]"), plane_scope);
  EXPECT_EQ(disc[0].at, Vec3(1, 2, 0));
  EXPECT_EQ(disc[0].spin, Vec3(0, 0, 7));
}

// With a count and a solid fraction, growth scales the diameters of the law by one factor.
TEST(ReadFeeding, GrowthOfACountScalesTheDiameters) {
  std::vector<Filling> fillings;
  const auto particles =
      feed(insert("sizes = { groups = [{ diameter = 0.01, count = 200 }, { diameter = 0.02, count = 100 }] }\ncount = 300\n"
                  "solid_fraction = 0.5\nplace = \"growth\"\nregion = { sphere = { centre = [0, 0, 1], radius = 0.4 } }\n"),
           space, &fillings);
  double volume = 0;
  std::map<double, int> counts;
  for (const auto& particle : particles) {
    volume += particle_volume(particle.radius, 3);
    ++counts[particle.radius];
  }
  EXPECT_NEAR(volume / (4.0 / 3 * M_PI * 0.064), 0.5, 1e-12);
  ASSERT_EQ(counts.size(), 2u);
  EXPECT_NEAR(counts.rbegin()->first / counts.begin()->first, 2, 1e-14);
  EXPECT_EQ(counts.begin()->second, 200);
  EXPECT_GE(least_gap(particles), 0);
  EXPECT_EQ(radii_of(fillings[0], 0, {}).size(), 300u);
}

// Given, grown, on a lattice, at random: all in one box, and clear of each other.
TEST(ReadFeeding, FillingsOfEveryKindKeepClearOfEachOther) {
  const auto particles = feed(insert("particles = [{ at = [0.5, 0.5, 0.9], diameter = 0.2 }]\n") +
                                  insert("diameter = 0.05\nsolid_fraction = 0.5\nplace = \"growth\"\nregion = { cylinder = { from = [0.2, "
                                         "0.2, 0], to = [0.2, 0.2, 0.6], radius = 0.2 } }\n") +
                                  insert("diameter = 0.06\nplace = \"lattice\"\nlattice = { kind = \"fcc\", spacing = 0.07, jitter = 0.8 "
                                         "}\nregion = { box = [[0.45, 0, 0], [1, 1, 0.3]] }\n") +
                                  insert("sizes = { uniform = [0.02, 0.05] }\ncount = 1000\nregion = { box = [[0, 0, 0], [1, 1, 1]] }\n"),
                              space);
  EXPECT_GT(particles.size(), 2000u);
  EXPECT_GE(least_gap(particles), 0);
}

TEST(ReadFeeding, InletsAndOutletsAreRead) {
  const auto root = io::Table::from_text(
      "[g]\ninlet = [{ material = \"steel\", rate = 2, diameter = 0.02, region = { box = [[0, 0, 0], [1, 1, 1]] }, "
      "velocity = [0, 0, -1], from = 1, until = 3, seed = 9 }]\noutlet = [{ region = { sphere = { centre = [0, 0, 0], "
      "radius = 0.5 } } }]",
      "case.toml");
  const auto inlet = read_inlet(root.table("g").list("inlet")[0], space, 0);
  EXPECT_EQ(inlet.density, 7800);
  EXPECT_EQ(inlet.rate, 2);
  EXPECT_EQ(inlet.until, 3);
  EXPECT_EQ(inlet.seed, 9u);
  const auto outlet = read_outlet(root.table("g").list("outlet")[0], space);
  EXPECT_EQ(outlet.name, "g.outlet[0]");
  EXPECT_TRUE(outlet.region.contains(Vec3(0, 0, 0.4)));
}

std::string message_of(const std::string& text, const FeedingScope& scope) {
  try {
    feed(text, scope);
  } catch (const io::UserError& error) {
    return error.what();
  }
  return "nothing was wrong";
}

TEST(FeedingErrors, EachIsLocatedAndSaysHowToMendIt) {
  const std::string good = insert("diameter = 0.05\ncount = 20\nplace = \"random\"\nregion = { box = [[0, 0, 0], [1, 1, 1]] }\n");
  ASSERT_EQ(message_of(good, space), "nothing was wrong");
  const auto sizes = [](const std::string& law) { return "sizes = { " + law + " }"; };
  const std::vector<std::array<std::string, 3>> mistakes{
      {"\"glass\"", "\"glas\"", "Did you mean \"glass\"?"},
      {"count = 20", "", "needs an amount: count, mass or solid_fraction"},
      {"count = 20", "count = 20\nmass = 3", "and count are both given"},
      {"count = 20", "count = 20\nsolid_fraction = 0.3", "only place = \"growth\" takes both"},
      {"count = 20", "solid_fraction = 1.2", "outside (0, 1)"},
      {"count = 20", "count = 200000", "use place = \"growth\""},
      {"count = 20", "mass = 1e-9", "less than half of its smallest sphere"},
      {"count = 20", "count = 20\nspin = 3", "must be a list of 3 numbers"},
      {"count = 20", "count = 20\nlattice = { jitter = 0.1 }", "Add place = \"lattice\" or remove it"},
      {"diameter = 0.05", "", "needs one of diameter, sizes"},
      {"diameter = 0.05", "diametre = 0.05", "Did you mean diameter?"},
      {"diameter = 0.05", "diameter = 0.05\nsizes = { uniform = [1, 2] }", "and diameter are both given"},
      {"diameter = 0.05", "diameter = 2", "no whole sphere fits"},
      {"diameter = 0.05", sizes("unifrom = [0.1, 0.2]"), "Did you mean uniform?"},
      {"diameter = 0.05", sizes("uniform = [0.2, 0.1]"), "is not [smallest, largest]"},
      {"diameter = 0.05", sizes("uniform = [0.1, 0.1]"), "For one size write diameter"},
      {"diameter = 0.05", sizes("uniform = [0, 0.1]"), "a diameter is positive"},
      {"diameter = 0.05", sizes("normal = { mean = 0.05, deviation = 0.02 }"), "reaches to zero"},
      {"diameter = 0.05", sizes("lognormal = { median = 0.05, deviation = 20 }"), "It is the deviation of ln d"},
      {"diameter = 0.05", sizes("groups = []"), "is empty"},
      {"diameter = 0.05", sizes("groups = [{ diameter = 0.05, count = 3 }]"), "is not the sum of the groups' counts, 3"},
      {"diameter = 0.05", sizes("groups = [{ diameter = 0.05, count = 3 }], by = \"mass\""), "does not go with groups"},
      {"diameter = 0.05", sizes("sieve = { openings = [0.01, 0.02], retained = [1, 1] }"), "the coarsest first"},
      {"diameter = 0.05", sizes("sieve = { openings = [0.02, 0.01], retained = [1, 1] }"), "Add largest"},
      {"diameter = 0.05", sizes("sieve = { openings = [0.02, 0.01], retained = [0, 1, 1] }"), "Add smallest"},
      {"diameter = 0.05", sizes("sieve = { openings = [0.02, 0.01], retained = [1] }"), "has 1 values for 2 openings"},
      {"diameter = 0.05", sizes("sieve = { openings = [0.02, 0.01], retained = [0, 0] }"), "holds no mass at all"},
      {"diameter = 0.05", sizes("sieve = { openings = [0.02, 0.01], passing = [50, 60] }"), "rises from a coarser sieve"},
      {"diameter = 0.05", sizes("sieve = { openings = [0.02, 0.01], retained = [1, 1], largest = 0.02 }"),
       "must be above the coarsest opening"},
      {"\"random\"", "\"randon\"", "Did you mean \"random\"?"},
      {"\"random\"", "\"lattice\"\nlattice = { spacing = 0.04 }", "neighbours would overlap"},
      {"\"random\"", "\"lattice\"\nlattice = { jitter = 0.4 }", "Add a spacing above the largest diameter"},
      {"\"random\"", "\"lattice\"\nlattice = { kind = \"hexagonal\" }", "is not one of \"cubic\", \"fcc\", \"hcp\""},
      {"place = \"random\"", "place = \"lattice\"\nlattice = { spacing = 0.5 }", "only 8 of 20 spheres of 0.05 m find a site"},
      {"diameter = 0.05\ncount = 20\nplace = \"random\"", "diameter = 0.15\nsolid_fraction = 0.75\nplace = \"growth\"",
       "Random close packing of equal spheres is near 64 %"},
      {"box = [[0, 0, 0], [1, 1, 1]]", "box = [[0, 0, 0]]", "must be two corners"},
      {"box = [[0, 0, 0], [1, 1, 1]]", "disc = { centre = [0, 0], radius = 1 }", "Use box, sphere or cylinder"},
      {"box = [[0, 0, 0], [1, 1, 1]]", "sphere = { centre = [0, 0, 0], radius = -1 }", "outside (0, inf)"},
      {"box = [[0, 0, 0], [1, 1, 1]]", "cylinder = { from = [0, 0, 0], to = [0, 0, 0], radius = 1 }", "is the same point as from"},
      {"box = [[0, 0, 0], [1, 1, 1]]", "bx = [[0, 0, 0], [1, 1, 1]]", "Did you mean box?"}};
  for (const auto& [from, to, expected] : mistakes) {
    auto text = good;
    const auto at = text.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    text.replace(at, from.size(), to);
    const auto message = message_of(text, space);
    EXPECT_NE(message.find(expected), std::string::npos) << to << "\n→ " << message;
    EXPECT_EQ(message.find("case.toml:"), 0u) << message;
  }
}

TEST(FeedingErrors, OfOtherTablesToo) {
  const std::string start = "[[g.inlet]]\nmaterial = \"glass\"\ndiameter = 0.02\nregion = { box = [[0, 0, 0], [1, 1, 1]] }\n";
  const std::vector<std::pair<std::string, std::string>> mistakes{
      {start, "rate is missing"},
      {start + "rate = -1", "outside (0, inf)"},
      {start + "rate = 1\ncount = 5", "which has a rate [kg/s]"},
      {start + "rate = 1\nfrom = 2\nuntil = 1", "is not after from"},
      {start + "rate = 1\nform = 2", "Did you mean from?"},
      {"[[g.outlet]]\nname = \"a\"", "region is missing"},
      {insert("particles = []"), "is empty"},
      {insert("particles = [{ at = [0, 0, 0], diameter = 0.1 }]\ncount = 1"), "does not go with particles"},
      {insert("diameter = 0.1\ncount = 30\nregion = { box = [[0, 0, 0], [1, 1, 1]] }\n") +
           insert("diameter = 0.1\nsolid_fraction = 0.5\nplace = \"growth\"\nregion = { box = [[0, 0, 0], [1, 1, 1]] }\n") +
           insert("particles = [{ at = [0.5, 0.5, 0.5], diameter = 0.1 }]"),
       "Growth needs an empty region"}};
  for (const auto& [text, expected] : mistakes) {
    const auto message = message_of(text, space);
    EXPECT_NE(message.find(expected), std::string::npos) << text << "\n→ " << message;
    EXPECT_EQ(message.find("case.toml:"), 0u) << message;
  }
  EXPECT_NE(message_of(insert("diameter = 0.1\ncount = 1\nregion = { sphere = { centre = [0, 0], radius = 1 } }"), plane_scope)
                .find("Use box or disc"),
            std::string::npos);
  EXPECT_NE(message_of(insert("diameter = 0.1\ncount = 1\nregion = { box = [[0, 0], [1, 1]] }\nspin = [0, 0, 1]"), plane_scope)
                .find("must be a number in two"),
            std::string::npos);
}

}  // namespace
}  // namespace acopla::dem::test
