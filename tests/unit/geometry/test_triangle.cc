#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>

#include "geometry/triangle.h"

namespace acopla::geometry {
namespace {

const Vec3 a(0, 0, 0), b(2, 0, 0), c(0, 1, 0);

TEST(NearestOnTriangle, EveryVoronoiRegionNamesItsFeature) {
  using F = TriangleFeature;
  const std::array<std::pair<Vec3, F>, 7> cases{{{{0.5, 0.2, 3}, F::face},
                                                 {{1, -1, 0.5}, F::edge0},
                                                 {{1.5, 1.5, -1}, F::edge1},
                                                 {{-1, 0.5, 0.2}, F::edge2},
                                                 {{-1, -1, 1}, F::vertex0},
                                                 {{4, 0, 0}, F::vertex1},
                                                 {{-0.5, 3, 0}, F::vertex2}}};
  for (const auto& [x, feature] : cases)
    EXPECT_EQ(nearest_on_triangle(x, a, b, c).feature, feature) << x.transpose();
}

TEST(NearestOnTriangle, IsNeverFartherThanAnyOtherPointOfTheTriangle) {
  // Reference: a dense sample of the triangle. The tolerance is round-off of coordinates of
  // order 1.
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> coordinate(-2, 3);
  for (int trial = 0; trial < 200; ++trial) {
    const Vec3 x(coordinate(random), coordinate(random), coordinate(random));
    const auto nearest = nearest_on_triangle(x, a, b, c);
    EXPECT_NEAR(nearest.weights[0] + nearest.weights[1] + nearest.weights[2], 1, 1e-15);
    EXPECT_NEAR(nearest.squared_distance, (x - nearest.point).squaredNorm(), 1e-14);
    for (int i = 0; i <= 20; ++i)
      for (int j = 0; i + j <= 20; ++j) {
        const Vec3 other = a + (b - a) * i / 20.0 + (c - a) * j / 20.0;
        EXPECT_LE(nearest.squared_distance, (x - other).squaredNorm() + 1e-14);
      }
  }
}

TEST(NearestOnTriangle, DoesNotDependOnTheNamesOfTheVertices) {
  // The same point whatever vertex comes first and whichever way round; round-off of coordinates of
  // order 1.
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> coordinate(-1, 1);
  const auto draw = [&] {
    return Vec3(coordinate(random), coordinate(random), coordinate(random));
  };
  for (int trial = 0; trial < 500; ++trial) {
    const std::array<Vec3, 3> v{draw(), draw(), draw()};
    const Vec3 x = draw();
    const Vec3 reference = nearest_on_triangle(x, v[0], v[1], v[2]).point;
    std::array<int, 3> order{0, 1, 2};
    do {
      const Vec3 point = nearest_on_triangle(x, v[order[0]], v[order[1]], v[order[2]]).point;
      EXPECT_LT((point - reference).norm(), 1e-12);  // 1e-12: slender triangles lose a few digits
    } while (std::next_permutation(order.begin(), order.end()));
  }
}

}  // namespace
}  // namespace acopla::geometry
