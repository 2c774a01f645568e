#include <gtest/gtest.h>

#include <limits>

#include "coupler/mapping/mapping.h"
#include "meshes.h"

namespace acopla::coupler {
namespace {

using namespace testing;

using Field = std::function<Vec3(const Vec3&)>;

std::vector<Vec3> sampled(const SurfaceMesh& mesh, const Field& field) {
  std::vector<Vec3> values;
  for (const auto& point : mesh.points) values.push_back(field(point));
  return values;
}

double work(const std::vector<Vec3>& forces, const std::vector<Vec3>& displacements) {
  double sum = 0;
  for (std::size_t k = 0; k < forces.size(); ++k) sum += forces[k].dot(displacements[k]);
  return sum;
}

TEST(ConsistentMapping, LinearFieldsAreExactBetweenAllKindsOnCoincidingPlanes) {
  // All shape functions reproduce linear fields; 1e-13 is round-off of values of order 5.
  const Field field = [](const Vec3& x) {
    return Vec3(1 + 2 * x.x() - x.y(), 0.5 * x.z() - 3 * x.y(), x.sum());
  };
  for (const auto a : all_kinds)
    for (const auto b : all_kinds) {
      if ((geometry::corners_of(a) == 2) != (geometry::corners_of(b) == 2)) continue;
      const auto from = skew(a, 5, 7), to = skew(b, 4, 3);
      const Mapping mapping(from, to, {1e-6});
      ASSERT_EQ(mapping.unmapped(), 0u);
      std::vector<Vec3> values(from.points.size());
      mapping.values(sampled(to, field), values);
      for (std::size_t k = 0; k < values.size(); ++k)
        EXPECT_LT((values[k] - field(from.points[k])).norm(), 1e-13)
            << name_of(a) << " from " << name_of(b);
    }
}

TEST(ConsistentMapping, QuadraticFieldsAreExactFromQuadraticFacesOnCoincidingPlanes) {
  // quad9 and triangle6 hold all polynomials of degree two in the plane.
  const Field field = [](const Vec3& x) {
    return Vec3(x.x() * x.x(), x.x() * x.y(), x.y() * x.y() - 2 * x.x());
  };
  for (const auto kind : {FaceKind::triangle6, FaceKind::quad9}) {
    const auto from = flat(FaceKind::triangle3, 7, 5), to = flat(kind, 3, 2);
    std::vector<Vec3> values(from.points.size());
    Mapping(from, to, {1e-6}).values(sampled(to, field), values);
    for (std::size_t k = 0; k < values.size(); ++k)
      EXPECT_LT((values[k] - field(from.points[k])).norm(), 1e-13);
  }
}

TEST(ConsistentMapping, IsIsoparametricOnCurvedFaces) {
  // Points on the curved faces themselves, at known parameters: the value is the shape functions'
  // there, and the identity field gives the point back. Newton leaves the square of 1e-11.
  for (const auto kind : {FaceKind::line3, FaceKind::quad9, FaceKind::triangle6}) {
    const auto to = kind == FaceKind::line3 ? ring(kind, 9, 0.7) : drum(kind, 9, 2);
    const auto nodal = random_vectors(to.points.size(), 19);
    SurfaceMesh from;
    std::vector<Vec3> expected;
    for (std::size_t face = 0; face < to.face_count(); ++face) {
      Vec2 p(0.31, 0.27);
      if (kind == FaceKind::line3) p.y() = 0;
      const auto weights = shape_functions(kind, p);
      Vec3 x = Vec3::Zero(), value = Vec3::Zero();
      for (std::size_t k = 0; k < geometry::nodes_of(kind); ++k) {
        x += weights[k] * to.points[to.nodes(face)[k]];
        value += weights[k] * nodal[to.nodes(face)[k]];
      }
      from.points.push_back(x);
      expected.push_back(value);
    }
    const Mapping mapping(from, to, {1e-6});
    std::vector<Vec3> values(from.points.size());
    mapping.values(nodal, values);
    for (std::size_t k = 0; k < values.size(); ++k)
      EXPECT_LT((values[k] - expected[k]).norm(), 1e-12) << name_of(kind);
    mapping.values(to.points, values);
    for (std::size_t k = 0; k < values.size(); ++k)
      EXPECT_LT((values[k] - from.points[k]).norm(), 1e-14);
  }
}

TEST(ConsistentMapping, IsTheTransposeOfTheForcesWhereSurfacesCoincide) {
  // Σ f_to · u_to = Σ f_from · u_from for any forces and displacements; 1e-12 of sums of some
  // hundred terms of order 1.
  for (const auto kind : surface_kinds) {
    const auto from = skew(FaceKind::triangle3, 6, 5), to = skew(kind, 4, 3);
    const Mapping mapping(from, to, {1e-6});
    const auto forces = random_vectors(from.points.size(), 20),
               displacements = random_vectors(to.points.size(), 21);
    std::vector<Vec3> received(to.points.size()), moved(from.points.size());
    mapping.forces(forces, received);
    mapping.values(displacements, moved);
    EXPECT_NEAR(work(received, displacements), work(forces, moved), 1e-12);
  }
}

TEST(ConjugateMapping, KeepsTheWorkOfAnyForcesOnSurfacesThatDoNotCoincide) {
  for (const auto kind : surface_kinds) {
    const auto from = drum(FaceKind::triangle3, 32, 5), to = drum(kind, 48, 3);
    const Mapping mapping(from, to, {0.02});
    const auto forces = random_vectors(from.points.size(), 22),
               displacements = random_vectors(to.points.size(), 23);
    std::vector<Vec3> received(to.points.size()), moved(from.points.size());
    mapping.forces(forces, received);
    mapping.conjugate_values(displacements, moved);
    EXPECT_NEAR(work(received, displacements), work(forces, moved), 1e-12);
  }
}

TEST(ConjugateMapping, CarriesAnyRigidMotionToPointsOffTheSurface) {
  // u = t + ω × x at the points themselves, not at their projections; in space and, about z, in the
  // plane.
  const Vec3 shift(0.3, -1, 2), spin(0.2, 0.7, -0.4);
  const auto check = [](const SurfaceMesh& from, const SurfaceMesh& to, double limit, const Vec3& t,
                        const Vec3& w) {
    const Field rigid = [&](const Vec3& x) { return Vec3(t + w.cross(x)); };
    std::vector<Vec3> moved(from.points.size());
    Mapping(from, to, {limit}).conjugate_values(sampled(to, rigid), moved);
    for (std::size_t k = 0; k < moved.size(); ++k)
      EXPECT_LT((moved[k] - rigid(from.points[k])).norm(), 1e-13);
  };
  for (const auto kind : surface_kinds)
    check(drum(FaceKind::triangle3, 32, 5), drum(kind, 48, 3), 0.02, shift, spin);
  for (const auto kind : {FaceKind::line2, FaceKind::line3})
    check(ring(FaceKind::line2, 32, 0.5), ring(kind, 48, 0.51), 0.03, {0.3, -1, 0}, {0, 0, 0.7});
}

TEST(ConsistentMapping, APointWithoutAPartnerGetsZero) {
  SurfaceMesh cloud;
  cloud.points = {{0.5, 0.5, 0}, {0, 0, 9}};
  const auto to = flat(FaceKind::quad4, 3, 3);
  std::vector<Vec3> values(2, Vec3::Ones());
  Mapping(cloud, to, {0.1}).values(std::vector<Vec3>(to.points.size(), Vec3(1, 2, 3)), values);
  EXPECT_LT((values[0] - Vec3(1, 2, 3)).norm(), 1e-14);
  EXPECT_EQ(values[1], Vec3::Zero());
}

}  // namespace
}  // namespace acopla::coupler
