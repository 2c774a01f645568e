#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <set>
#include <stdexcept>
#include <vector>

#include "geometry/bucket_grid.h"

namespace acopla::geometry {
namespace {

using Boxes = std::vector<Box>;

bool touch(const Box& a, const Box& b) {
  return (a.low.array() <= b.high.array()).all() && (b.low.array() <= a.high.array()).all();
}

std::set<std::uint32_t> found_in(const BucketGrid& grid, const Box& box) {
  std::set<std::uint32_t> items;
  grid.for_each_near(box.low, box.high, [&](std::uint32_t item) { items.insert(item); });
  return items;
}

/// Boxes whose edges span six decades, some of them flat or mere points.
Boxes random_boxes(std::size_t count, std::mt19937_64& random) {
  std::uniform_real_distribution<double> coordinate(-1, 1), decade(-6, 0);
  Boxes boxes(count);
  for (std::size_t k = 0; k < count; ++k) {
    const double edge = k % 17 == 0 ? 0 : std::pow(10, decade(random));
    const Vec3 low(coordinate(random), coordinate(random), k % 5 == 0 ? 0.25 : coordinate(random));
    boxes[k] = {low, low + edge * Vec3(1, 0.5, k % 3 == 0 ? 0 : 1)};
  }
  return boxes;
}

/// Square faces of edge 1/n on the six sides of the unit cube: hollow, 6 n² items.
Boxes cube_faces(int n) {
  Boxes boxes;
  const double h = 1.0 / n;
  for (int axis = 0; axis < 3; ++axis)
    for (const double side : {0.0, 1.0})
      for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
          Vec3 low, high;
          low[axis] = high[axis] = side;
          low[(axis + 1) % 3] = i * h;
          high[(axis + 1) % 3] = (i + 1) * h;
          low[(axis + 2) % 3] = j * h;
          high[(axis + 2) % 3] = (j + 1) * h;
          boxes.push_back({low, high});
        }
  return boxes;
}

TEST(BucketGrid, FindsEveryBoxThatAnExhaustiveTestFinds) {
  std::mt19937_64 random(5);
  const auto boxes = random_boxes(2000, random);
  const auto queries = random_boxes(300, random);
  for (const double size : {0.0, 1e-9, 0.01, 0.3, 100.0}) {
    const BucketGrid grid(boxes, size);
    for (const auto& query : queries) {
      const auto found = found_in(grid, query);
      for (std::uint32_t item = 0; item < boxes.size(); ++item)
        if (touch(boxes[item], query)) {
          EXPECT_TRUE(found.count(item)) << "size " << size << " item " << item;
        }
    }
  }
}

TEST(BucketGrid, AQueryOfTheWholeSpaceFindsEverythingAndOneOutsideNothing) {
  const auto boxes = cube_faces(6);
  const BucketGrid grid(boxes);
  const double inf = std::numeric_limits<double>::infinity(),
               nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(found_in(grid, {Vec3::Constant(-inf), Vec3::Constant(inf)}).size(), boxes.size());
  EXPECT_TRUE(found_in(grid, {Vec3::Constant(1.5), Vec3::Constant(1e300)}).empty());
  EXPECT_TRUE(found_in(grid, {Vec3::Constant(nan), Vec3::Constant(nan)}).empty());
  EXPECT_TRUE(found_in(grid, {Vec3::Constant(0.6), Vec3::Constant(0.4)}).empty());
  EXPECT_TRUE(found_in(BucketGrid(Boxes{}), {Vec3::Zero(), Vec3::Ones()}).empty());
}

TEST(BucketGrid, WorkAndMemoryAnItemDoNotGrowOnAHollowSurface) {
  // Counts, not times. In the plane of its side a face reaches into at most 2 × 2 buckets, across
  // it into one: 4 entries, and a box of a face's size touches at most 2 × 2 × 2 buckets of (1.5
  // h)³, 4 of them with some 2.25 faces and their neighbours' overlaps. A dense grid over the cube
  // would grow as n^(1/3).
  for (const int n : {13, 41, 129}) {  // 1e3, 1e4, 1e5 items
    const auto boxes = cube_faces(n);
    const BucketGrid grid(boxes);
    EXPECT_LE(grid.stored(), 4 * boxes.size());
    std::size_t most = 0;
    const Vec3 half = Vec3::Constant(0.25 / n);
    for (std::size_t k = 0; k < boxes.size(); k += 7) {
      const Vec3 middle = 0.5 * (boxes[k].low + boxes[k].high);
      std::size_t visits = 0;
      grid.for_each_near(middle - half, middle + half, [&](std::uint32_t) { ++visits; });
      most = std::max(most, visits);
    }
    EXPECT_LE(most, 100u) << boxes.size();
  }
}

TEST(BucketGrid, AHugeItemAmongSmallOnesCostsNoMoreThanEightBuckets) {
  auto boxes = cube_faces(20);
  boxes.push_back({Vec3::Constant(-1e4), Vec3::Constant(1e4)});
  const BucketGrid grid(boxes);
  EXPECT_LE(grid.stored(), 8 * boxes.size());
  const auto found = found_in(grid, {Vec3::Constant(500), Vec3::Constant(501)});
  EXPECT_TRUE(found.count(static_cast<std::uint32_t>(boxes.size() - 1)));
  // The small faces keep buckets of their own size.
  EXPECT_LT(found_in(grid, {Vec3(0.5, 0.5, 0), Vec3(0.51, 0.51, 0)}).size(), 100u);
}

TEST(BucketGrid, RefusesWhatIsNotANumberOrNotABox) {
  const double inf = std::numeric_limits<double>::infinity(),
               nan = std::numeric_limits<double>::quiet_NaN();
  for (const double bad : {inf, -inf, nan}) {
    EXPECT_THROW(BucketGrid(Boxes{{Vec3(bad, 0, 0), Vec3::Ones()}}), std::invalid_argument);
    EXPECT_THROW(BucketGrid(Boxes{{Vec3::Zero(), Vec3(1, 1, bad)}}), std::invalid_argument);
    EXPECT_THROW(BucketGrid(Boxes{{Vec3::Zero(), Vec3::Ones()}}, bad), std::invalid_argument);
  }
  EXPECT_THROW(BucketGrid(Boxes{{Vec3(1, 0, 0), Vec3(0, 1, 1)}}), std::invalid_argument);
  EXPECT_THROW(BucketGrid(Boxes{{Vec3::Constant(-1e308), Vec3::Constant(1e308)}}),
               std::invalid_argument);
}

TEST(BucketGrid, ItemsAllInOnePlaceAreFound) {
  const Boxes boxes(100, Box{Vec3(1, 2, 3), Vec3(1, 2, 3)});
  EXPECT_EQ(found_in(BucketGrid(boxes), {Vec3(1, 2, 3), Vec3(1, 2, 3)}).size(), 100u);
}

}  // namespace
}  // namespace acopla::geometry
