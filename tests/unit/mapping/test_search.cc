#include <gtest/gtest.h>

#include <limits>

#include "coupler/mapping/search.h"
#include "meshes.h"

namespace acopla::coupler {
namespace {

using namespace testing;

constexpr double everywhere = std::numeric_limits<double>::infinity();

void expect_same(const PartnerSearch& search, const Vec3& x, double limit) {
  const auto bucket = search.nearest(x, limit), oracle = search.nearest_exhaustive(x, limit);
  ASSERT_EQ(bucket.has_value(), oracle.has_value()) << x.transpose();
  if (!bucket) return;
  EXPECT_EQ(bucket->face, oracle->face) << x.transpose();
  EXPECT_EQ(bucket->projection.weights,
            oracle->projection.weights);  // the same arithmetic, to the bit
  for (const auto guess : {0u, oracle->face, oracle->examined - 1}) {  // first, right, last
    const auto guessed = search.nearest(x, limit, guess);
    ASSERT_TRUE(guessed);
    EXPECT_EQ(guessed->face, oracle->face) << x.transpose() << " guessing " << guess;
    EXPECT_EQ(guessed->projection.weights, oracle->projection.weights);
  }
}

TEST(PartnerSearch, BucketsEqualTheExhaustiveSearchForRandomPoints) {
  for (const auto kind : surface_kinds)
    for (const auto& mesh : {open_box(kind, 7), drum(kind, 17, 5)}) {
      const PartnerSearch search(mesh);
      for (const auto& draw : random_vectors(300, 13))
        for (const double limit : {0.02, 0.3, everywhere})
          expect_same(search, Vec3(0.5, 0.4, 0.8) + draw, limit);
    }
}

TEST(PartnerSearch, BucketsEqualTheExhaustiveSearchOnSharedEdgesAndCorners) {
  // Nodes and middles of all edges, on the surface and moved off it: distances to several faces are
  // equal but for round-off, and the lowest index must win both ways.
  for (const auto kind : surface_kinds) {
    const auto mesh = open_box(kind, 5);
    const PartnerSearch search(mesh);
    for (std::size_t face = 0; face < mesh.face_count(); ++face) {
      const auto nodes = mesh.nodes(face);
      const std::size_t corners = geometry::corners_of(kind);
      for (std::size_t k = 0; k < corners; ++k) {
        const Vec3 a = mesh.points[nodes[k]], b = mesh.points[nodes[(k + 1) % corners]];
        for (const Vec3& x : {a, Vec3(0.5 * (a + b)), Vec3(0.3 * a + 0.7 * b)})
          for (const Vec3& off : {Vec3(0, 0, 0), Vec3(1e-3, 2e-3, 3e-3), Vec3(-1e-2, -1e-2, -1e-2)})
            expect_same(search, x + off, 0.05);
      }
    }
  }
}

TEST(PartnerSearch, ATieGoesToTheLowestIndex) {
  // A fan of 100 triangles about the origin: all of them are equally near to every point of the
  // axis.
  SurfaceMesh fan;
  fan.points.push_back(Vec3::Zero());
  for (int k = 0; k < 100; ++k) {
    const double angle = 2 * std::numbers::pi * k / 100;
    fan.points.emplace_back(std::cos(angle), std::sin(angle), 0);
  }
  for (std::uint32_t k = 0; k < 100; ++k)
    fan.add_face(FaceKind::triangle3, std::array<std::uint32_t, 3>{0, 1 + k, 1 + (k + 1) % 100});
  const PartnerSearch search(fan);
  for (const double height : {0.0, 1e-9, 0.3, -2.0}) {
    const auto partner = search.nearest({0, 0, height}, 3);
    ASSERT_TRUE(partner);
    EXPECT_EQ(partner->face, 0u);
    expect_same(search, {0, 0, height}, 3);
  }
}

TEST(PartnerSearch, FindsTheFacesOfAPlaneCurve) {
  for (const auto kind : {FaceKind::line2, FaceKind::line3}) {
    const auto mesh = ring(kind, 30, 1);
    const PartnerSearch search(mesh);
    for (const auto& x : random_vectors(300, 14, true)) expect_same(search, 1.5 * x, 0.4);
    for (const auto& x : mesh.points) expect_same(search, x, 0.4);
  }
}

TEST(PartnerSearch, NothingBeyondTheLimitAndSomethingOnIt) {
  const auto mesh = flat(FaceKind::quad4, 3, 3);
  const PartnerSearch search(mesh);
  for (const double limit : {1e-6, 0.25, 10.0}) {
    EXPECT_TRUE(search.nearest({0.4, 0.4, limit}, limit));
    EXPECT_FALSE(search.nearest({0.4, 0.4, limit * (1 + 1e-9)}, limit));
  }
  EXPECT_FALSE(
      search.nearest(Vec3::Constant(std::numeric_limits<double>::quiet_NaN()), everywhere));
  EXPECT_TRUE(search.nearest(Vec3::Constant(1e12), everywhere));
  const SurfaceMesh nothing;
  EXPECT_FALSE(PartnerSearch(nothing).nearest(Vec3::Zero(), everywhere));
}

TEST(PartnerSearch, FacesExaminedAPointStayBoundedFromAThousandToAHundredThousand) {
  // A count and not a time: the faces whose boxes hold a point near the surface do not depend on
  // how many there are.
  double least = 1e300, most = 0;
  for (const int n : {9, 29, 91}) {  // 10 n (n + 1) triangles and more: 1e3, 1e4, 1e5
    const auto mesh = open_box(FaceKind::triangle3, n);
    const PartnerSearch search(mesh);
    double examined = 0;
    int count = 0;
    for (const auto& draw : random_vectors(2000, 15)) {
      const Vec3 x(0.5 + 0.5 * draw.x(), 0.5 + 0.5 * draw.y(), 0.02 / n * draw.z());
      const auto partner = search.nearest(x, 0.1);
      ASSERT_TRUE(partner);
      EXPECT_LE(partner->examined, 20u);
      examined += partner->examined;
      ++count;
    }
    least = std::min(least, examined / count);
    most = std::max(most, examined / count);
  }
  EXPECT_LT(most, 1.5 * least);
}

TEST(PartnerSearch, RefusesASurfaceThatIsNotFinite) {
  auto mesh = flat(FaceKind::triangle3, 2, 2);
  mesh.points[0].x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(PartnerSearch{mesh}, std::invalid_argument);
}

}  // namespace
}  // namespace acopla::coupler
