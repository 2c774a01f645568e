#include <gtest/gtest.h>

#include <numeric>

#include "coupler/mapping/face_shape.h"
#include "meshes.h"

namespace acopla::coupler {
namespace {

using namespace testing;

std::vector<Vec2> parameters_in(FaceKind kind, int count, unsigned seed) {
  std::vector<Vec2> result;
  for (const auto& draw : random_vectors(static_cast<std::size_t>(count), seed)) {
    Vec2 p = draw.head<2>();
    if (geometry::corners_of(kind) == 2) p[1] = 0;
    if (geometry::corners_of(kind) == 3) {
      p = 0.5 * (p + Vec2::Ones());
      if (p.sum() > 1) p = Vec2::Ones() - p;
    }
    result.push_back(p);
  }
  return result;
}

/// One face with its nodes where the parameters are, bent out of plane by `bend`.
std::vector<Vec3> face_of(FaceKind kind, double bend) {
  std::vector<Vec3> nodes;
  for (const auto& p : node_parameters(kind))
    nodes.push_back(geometry::corners_of(kind) == 2
                        ? Vec3(1.5 * p[0], bend * (p[0] * p[0] + 0.3 * p[0]), 0)
                        : Vec3(1.5 * p[0] + 0.2 * p[1], p[1] - 0.1 * p[0],
                               bend * (p[0] * p[0] - 0.6 * p[0] * p[1])));
  return nodes;
}

Vec3 point_at(FaceKind kind, const std::vector<Vec3>& nodes, const Vec2& p) {
  const auto weights = shape_functions(kind, p);
  Vec3 point = Vec3::Zero();
  for (std::size_t k = 0; k < nodes.size(); ++k) point += weights[k] * nodes[k];
  return point;
}

TEST(FaceShape, ShapeFunctionsAreOneAtTheirNodeAndZeroAtTheOthers) {
  for (const auto kind : all_kinds) {
    const auto at = node_parameters(kind);
    ASSERT_EQ(at.size(), geometry::nodes_of(kind));
    for (std::size_t i = 0; i < at.size(); ++i) {
      const auto values = shape_functions(kind, at[i]);
      for (std::size_t k = 0; k < max_face_nodes; ++k)
        EXPECT_EQ(values[k], i == k ? 1.0 : 0.0) << name_of(kind);
    }
  }
}

TEST(FaceShape, PartitionOfUnityAndLinearCompleteness) {
  // Exact; nine terms of order 1 leave a few units of 1e-16.
  for (const auto kind : all_kinds)
    for (const auto& p : parameters_in(kind, 100, 6)) {
      const auto values = shape_functions(kind, p);
      double sum = 0;
      Vec2 position = Vec2::Zero();
      for (std::size_t k = 0; k < geometry::nodes_of(kind); ++k) {
        sum += values[k];
        position += values[k] * node_parameters(kind)[k];
      }
      EXPECT_NEAR(sum, 1, 1e-15);
      EXPECT_LT((position - p).norm(), 2e-15);
    }
}

TEST(FaceShape, DerivativesMatchDifferences) {
  // Central differences of polynomials of degree 2 a direction are exact up to round-off / step =
  // 1e-16 / 1e-3 for first and 1e-16 / 1e-6 for second derivatives.
  const double h = 1e-3;
  const Vec2 u(h, 0), v(0, h);
  for (const auto kind : all_kinds)
    for (const auto& p : parameters_in(kind, 20, 7)) {
      const auto basis = shape_basis(kind, p);
      const auto at = [&](const Vec2& d, std::size_t k) { return shape_functions(kind, p + d)[k]; };
      for (std::size_t k = 0; k < geometry::nodes_of(kind); ++k) {
        EXPECT_NEAR(basis.u[k], (at(u, k) - at(-u, k)) / (2 * h), 1e-12);
        EXPECT_NEAR(basis.uu[k], (at(u, k) - 2 * at({0, 0}, k) + at(-u, k)) / (h * h), 1e-8);
        if (geometry::corners_of(kind) == 2) continue;
        EXPECT_NEAR(basis.v[k], (at(v, k) - at(-v, k)) / (2 * h), 1e-12);
        EXPECT_NEAR(basis.vv[k], (at(v, k) - 2 * at({0, 0}, k) + at(-v, k)) / (h * h), 1e-8);
        EXPECT_NEAR(basis.uv[k],
                    (at(u + v, k) - at(u - v, k) - at(v - u, k) + at(-u - v, k)) / (4 * h * h),
                    1e-8);
      }
    }
}

TEST(FaceProjection, OfAPointOnTheFaceIsThePointItself) {
  // Bent faces included. Newton stops when the parameters move less than 1e-11, with the square of
  // that left.
  for (const auto kind : all_kinds)
    for (const double bend : {0.0, 0.3}) {
      const auto nodes = face_of(kind, bend);
      for (const auto& p : parameters_in(kind, 200, 8)) {
        const auto result = project_on_face(kind, nodes, point_at(kind, nodes, p));
        EXPECT_LT(result.distance, 1e-14) << name_of(kind);
        EXPECT_LT((result.parameters - p).norm(), 1e-13) << name_of(kind) << " bend " << bend;
        EXPECT_NEAR(std::accumulate(result.weights.begin(), result.weights.end(), 0.0), 1, 1e-15);
      }
    }
}

TEST(FaceProjection, IsTheNearestOfADenseSampleOfTheFace) {
  // Reference: 81 × 81 points of the face, which cannot be nearer than the nearest one (round-off
  // apart).
  for (const auto kind : all_kinds)
    for (const double bend : {0.0, 0.25}) {
      const auto nodes = face_of(kind, bend);
      for (const auto& x : random_vectors(60, 9)) {
        const Vec3 point = 2 * x;
        const auto result = project_on_face(kind, nodes, point);
        EXPECT_TRUE(result.converged) << name_of(kind);
        EXPECT_NEAR(result.distance, (point - result.point).norm(), 1e-15);
        EXPECT_LT((point_at(kind, nodes, result.parameters) - result.point).norm(), 1e-14);
        double least = 1e300;
        for (int i = 0; i <= 80; ++i)
          for (int j = 0; j <= (geometry::corners_of(kind) == 2 ? 0 : 80); ++j) {
            Vec2 p(i / 40.0 - 1, geometry::corners_of(kind) == 2 ? 0 : j / 40.0 - 1);
            if (geometry::corners_of(kind) == 3) p = {i / 80.0, (1 - i / 80.0) * j / 80.0};
            least = std::min(least, (point - point_at(kind, nodes, p)).norm());
          }
        EXPECT_LE(result.distance, least + 1e-12) << name_of(kind) << " bend " << bend;
      }
    }
}

TEST(FaceProjection, AffineFacesTakeOneStep) {
  for (const auto kind : {FaceKind::line3, FaceKind::triangle6, FaceKind::quad4, FaceKind::quad9}) {
    const auto nodes = face_of(kind, 0);
    for (const auto& x : random_vectors(100, 10))
      EXPECT_LE(project_on_face(kind, nodes, 2 * x).iterations, 1) << name_of(kind);
  }
}

TEST(FaceProjection, OnACylinderOfQuadraticFacesIsRadial) {
  // A quad9 over 15 degrees of a circle misses it by about R θ⁴ / 384 (interpolation by parabolas)
  // = 1.2e-5 R.
  const auto mesh = drum(FaceKind::quad9, 24, 2);
  std::vector<Vec3> nodes;
  for (const auto node : mesh.nodes(0)) nodes.push_back(mesh.points[node]);
  for (const double radius : {0.45, 0.5, 0.6}) {
    const double angle = 0.1;
    const Vec3 x(radius * std::cos(angle), 0.13, radius * std::sin(angle));
    const auto result = project_on_face(FaceKind::quad9, nodes, x);
    EXPECT_NEAR(result.distance, std::abs(radius - 0.5), 1e-5);
    EXPECT_NEAR(result.point.y(), 0.13, 1e-12);
  }
}

TEST(FaceProjection, DegenerateFacesGiveAPointOfTheFace) {
  // Collapsed triangles, quads with two corners in one place, all nodes in one place: weights stay
  // a partition of unity and nothing is NaN.
  const Vec3 p(0.3, 0.2, 0.1), q(1, 0, 0), r(0, 1, 0);
  const std::vector<std::pair<FaceKind, std::vector<Vec3>>> faces{
      {FaceKind::line2, {p, p}},
      {FaceKind::line3, {p, p, p}},
      {FaceKind::triangle3, {p, p, q}},
      {FaceKind::triangle3, {p, q, p}},
      {FaceKind::triangle3, {p, p, p}},
      {FaceKind::quad4, {p, q, r, r}},
      {FaceKind::quad4, {p, p, p, p}},
      {FaceKind::quad4, {p, q, q, p}},
      {FaceKind::triangle6, std::vector<Vec3>(6, p)},
      {FaceKind::quad9, std::vector<Vec3>(9, p)}};
  for (const auto& [kind, nodes] : faces)
    for (const auto& x : random_vectors(20, 11)) {
      const auto result = project_on_face(kind, nodes, x);
      EXPECT_NEAR(std::accumulate(result.weights.begin(), result.weights.end(), 0.0), 1, 1e-14);
      EXPECT_TRUE(std::isfinite(result.distance));
      EXPECT_LE(result.distance, (x - nodes[0]).norm() + 1e-12) << name_of(kind);
    }
}

TEST(FaceBox, HoldsTheWholeOfACurvedFace) {
  for (const auto kind : all_kinds) {
    auto nodes = face_of(kind, 0.4);
    nodes.back() += Vec3(0.3, 0.2, 0.1);  // an edge that bulges past its nodes
    const auto box = box_of_face(kind, nodes);
    for (const auto& p : parameters_in(kind, 500, 12)) {
      const Vec3 x = point_at(kind, nodes, p);
      EXPECT_TRUE((x.array() >= box.low.array() - 1e-14).all() &&
                  (x.array() <= box.high.array() + 1e-14).all());
    }
  }
}

}  // namespace
}  // namespace acopla::coupler
