#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "coupler/mapping/balance.h"
#include "coupler/mapping/mapping.h"
#include "meshes.h"

namespace acopla::coupler {
namespace {

using namespace testing;

std::vector<Vec3> mapped(const Mapping& mapping, const std::vector<Vec3>& forces) {
  std::vector<Vec3> received(mapping.to_count(),
                             Vec3::Constant(std::numeric_limits<double>::quiet_NaN()));
  mapping.forces(forces, received);
  return received;
}

/// Statics, exact: 1e-12 is the project's limit for Σ force and Σ moment, relative to Σ|F| and
/// Σ|r||F|, and leaves four digits of room for round-off.
void expect_conserved(const SurfaceMesh& from, const SurfaceMesh& to, double max_distance,
                      const char* what, bool in_plane = false) {
  const Mapping mapping(from, to, {max_distance});
  ASSERT_EQ(mapping.unmapped(), 0u) << what;
  EXPECT_EQ(mapping.couples_lost(), 0u) << what;
  const auto forces = random_vectors(from.points.size(), 16, in_plane);
  const Vec3 about = to.centroid();
  const auto sent = resultant(from.points, forces, about);
  const auto received = resultant(to.points, mapped(mapping, forces), about);
  EXPECT_LT(loss(sent, received).force, 1e-12) << what;
  EXPECT_LT(loss(sent, received).moment, 1e-12) << what;
}

SurfaceMesh turned(SurfaceMesh mesh, const Eigen::Matrix3d& rotation, const Vec3& shift) {
  for (auto& point : mesh.points) point = rotation * point + shift;
  return mesh;
}

TEST(ConservativeMapping, KeepsForceAndMomentOnNonMatchingFlatGrids) {
  for (const auto a : surface_kinds)
    for (const auto b : surface_kinds)
      expect_conserved(skew(a, 5, 7), skew(b, 4, 3), 0.01, name_of(b).data());
}

TEST(ConservativeMapping, KeepsForceAndMomentInsideABox) {
  for (const auto kind : {FaceKind::quad4, FaceKind::quad9, FaceKind::triangle6})
    expect_conserved(open_box(FaceKind::triangle3, 11), open_box(kind, 4), 1e-6,
                     name_of(kind).data());
}

TEST(ConservativeMapping, KeepsForceAndMomentOnDrumsThatDoNotCoincide) {
  for (const auto kind : surface_kinds) {
    const auto from = drum(FaceKind::triangle3, 32, 5), to = drum(kind, 48, 3);
    expect_conserved(from, to, 0.02, name_of(kind).data());
    expect_conserved(to, from, 0.02, name_of(kind).data());
    if (quadratic(kind)) continue;
    // A corner of the 32-gon lies outside the sides of the 48-gon by up to R (1 − cos(π/48)).
    const Mapping mapping(from, to, {0.02});
    EXPECT_GT(mapping.worst_distance(), 1e-4);
    EXPECT_LE(mapping.worst_distance(), 0.5 * (1 - std::cos(std::numbers::pi / 48)) + 1e-12);
  }
}

TEST(ConservativeMapping, WithoutTheCoupleDrumsThatDoNotCoincideWouldLoseMoment) {
  // The couple is needed: Hᵀ alone, Σ w_k f, loses Σ (x − Px) × f.
  const auto from = drum(FaceKind::triangle3, 32, 5), to = drum(FaceKind::quad4, 48, 3);
  const Mapping mapping(from, to, {0.02});
  const auto forces = random_vectors(from.points.size(), 16);
  std::vector<Vec3> projected(from.points.size());
  mapping.values(to.points, projected);  // the identity field gives Px
  const auto sent = resultant(from.points, forces, to.centroid());
  EXPECT_GT(loss(sent, resultant(projected, forces, to.centroid())).moment, 1e-5);
}

TEST(ConservativeMapping, KeepsForceAndMomentInThePlaneOnRingsThatDoNotCoincide) {
  // Two nodes carry a couple about z, though their line could not carry one about itself.
  for (const auto a : {FaceKind::line2, FaceKind::line3})
    for (const auto b : {FaceKind::line2, FaceKind::line3})
      expect_conserved(ring(a, 32, 0.5), ring(b, 48, 0.51), 0.03, name_of(b).data(), true);
}

TEST(ConservativeMapping, LinesInThePlaneGiveForcesInThePlane) {
  const auto from = ring(FaceKind::line2, 32, 0.5), to = ring(FaceKind::line2, 48, 0.51);
  const auto received =
      mapped(Mapping(from, to, {0.03}), random_vectors(from.points.size(), 17, true));
  for (const auto& force : received) EXPECT_EQ(force.z(), 0);
}

TEST(ConservativeMapping, ASliverHandsItsCoupleToItsNeighbours) {
  // A triangle of height 1e-5 between two good ones: its own nodes cannot carry a couple about its
  // length.
  SurfaceMesh to;
  to.points = {{0, 0, 0}, {1, 0, 0}, {0.5, 1e-5, 0}, {0.5, -1, 0}, {0, 1, 0}};
  to.add_face(FaceKind::triangle3, std::array<std::uint32_t, 3>{0, 1, 2});
  to.add_face(FaceKind::triangle3, std::array<std::uint32_t, 3>{0, 3, 1});
  to.add_face(FaceKind::triangle3, std::array<std::uint32_t, 3>{0, 2, 4});
  SurfaceMesh from;
  from.points = {{0.5, 5e-6, 0.1}};  // a cloud of one point
  const Mapping mapping(from, to, {0.2});
  EXPECT_EQ(mapping.couples_spread(), 1u);
  expect_conserved(from, to, 0.2, "sliver");
}

TEST(ConservativeMapping, ACoupleThatNothingCanCarryIsCountedAndTheRestIsCarried) {
  SurfaceMesh to;
  to.points = {{0, 0, 0}, {1, 0, 0}, {0.5, 1e-6, 0}};
  to.add_face(FaceKind::triangle3, std::array<std::uint32_t, 3>{0, 1, 2});
  SurfaceMesh from;
  from.points = {{0.5, 0, 0.1}};
  const Mapping mapping(from, to, {0.2});
  EXPECT_EQ(mapping.couples_lost(), 1u);
  const std::vector<Vec3> forces{{1, 2, 3}};
  const auto received = resultant(to.points, mapped(mapping, forces), Vec3::Zero());
  const auto sent = resultant(from.points, forces, Vec3::Zero());
  EXPECT_LT((received.force - sent.force).norm(), 1e-14);
  // Lost is what turns about the sliver, (x − Px) × f · e_x = −0.1 × 2; the axis is e_x to about
  // its height, 1e-6.
  EXPECT_LT((sent.moment - received.moment - Vec3(-0.2, 0, 0)).norm(), 1e-5);
}

TEST(ConservativeMapping, LinesInSpaceReportTheCoupleAboutThemselves) {
  SurfaceMesh to = flat(FaceKind::line2, 3, 1), from;
  from.points = {{0.2, 0, 0.1}, {0.7, 0.1, 0}};
  const Mapping mapping(from, to, {0.2});
  EXPECT_EQ(mapping.couples_lost(), 2u);
}

TEST(ConservativeMapping, ResultsTurnWithTheFrame) {
  // Surfaces that do not coincide, all turned and moved: forces turn too, to round-off of
  // coordinates of order 3.
  const Eigen::Matrix3d rotation =
      Eigen::AngleAxisd(0.83, Vec3(1, -2, 0.5).normalized()).toRotationMatrix();
  const Vec3 shift(1, -2, 0.5);
  for (const auto kind : surface_kinds) {
    auto from = drum(FaceKind::triangle3, 29, 7), to = drum(kind, 48, 3);
    // No point on an edge, where the nearest of two faces would be a matter of round-off.
    for (auto& point : from.points)
      point = Eigen::AngleAxisd(0.0123, Vec3::UnitY()) * point + Vec3(0, 0.0031, 0);
    const auto forces = random_vectors(from.points.size(), 18);
    auto turned_forces = forces;
    for (auto& force : turned_forces) force = rotation * force;
    const auto here = mapped(Mapping(from, to, {0.05}), forces);
    const auto there = mapped(
        Mapping(turned(from, rotation, shift), turned(to, rotation, shift), {0.05}), turned_forces);
    for (std::size_t k = 0; k < here.size(); ++k)
      EXPECT_LT((rotation * here[k] - there[k]).norm(), 1e-11) << name_of(kind);
  }
}

TEST(ConservativeMapping, UniformPressurePassesThePatchTestFromANestedMeshOfTheSameOrder) {
  // Halving the faces of `to` gives a space that contains its shape functions, N_k = Σ N_k(x_i)
  // n_i, so Σ N_k(x_i) ∫ p n_i = ∫ p N_k exactly: consistent loads arrive as consistent loads.
  // Loads sum to 1 N; 1e-14 is round-off. (quad4 is nested too; a triangle3 mesh into quad4 is
  // not.)
  for (const auto kind : all_kinds) {
    const auto from = flat(kind, 6, 4), to = flat(kind, 3, 2);
    const auto received = mapped(Mapping(from, to, {1e-6}), uniform_pressure(from));
    const auto expected = uniform_pressure(to);
    for (std::size_t k = 0; k < expected.size(); ++k)
      EXPECT_LT((received[k] - expected[k]).norm(), 1e-14) << name_of(kind) << " node " << k;
  }
}

TEST(ConservativeMapping, UniformPressureFromFineTrianglesTendsToQuadraticLoadsWithSecondOrder) {
  // Triangles interpolate the quadratic shape functions linearly: nodal loads differ by the
  // integral of that error, which falls with h². The resultant and the first moments (N_k sum to 1
  // and reproduce x) are exact for every h.
  for (const auto kind : {FaceKind::quad9, FaceKind::triangle6}) {
    const auto to = flat(kind, 2, 2);
    const auto expected = uniform_pressure(to);
    std::vector<double> errors;
    for (const int n : {8, 16, 32}) {
      const auto from = flat(FaceKind::triangle3, n, n);
      const auto received = mapped(Mapping(from, to, {1e-6}), uniform_pressure(from));
      const auto sum = resultant(to.points, received, Vec3(0.5, 0.5, 0));
      EXPECT_LT((sum.force - Vec3(0, 0, 1)).norm(), 1e-13);
      EXPECT_LT(sum.moment.norm(), 1e-13);
      double error = 0;
      for (std::size_t k = 0; k < expected.size(); ++k)
        error = std::max(error, (received[k] - expected[k]).norm());
      errors.push_back(error);
    }
    EXPECT_GT(errors[1] / errors[2], 3.5) << name_of(kind);
    EXPECT_LT(errors[1] / errors[2], 4.5) << name_of(kind);
  }
}

TEST(ConservativeMapping, PointsBeyondTheLimitAreCountedAndNamed) {
  auto from = flat(FaceKind::triangle3, 3, 3);
  from.points[2].z() = 0.5;
  from.points[7].z() = -0.3;
  const Mapping mapping(from, flat(FaceKind::quad4, 2, 2), {0.1});
  ASSERT_EQ(mapping.unmapped(), 2u);
  EXPECT_EQ(mapping.unmapped_points()[0], 2u);
  EXPECT_EQ(mapping.unmapped_points()[1], 7u);
  EXPECT_LT(mapping.worst_distance(), 1e-15);
}

TEST(ConservativeMapping, PointsThatNoFaceNamesAreIgnoredButAllPointsOfACloudCount) {
  auto from = flat(FaceKind::triangle3, 2, 2);
  from.points.emplace_back(0, 0, 9);
  from.points.push_back(Vec3::Constant(std::numeric_limits<double>::quiet_NaN()));
  const auto to = flat(FaceKind::quad4, 3, 3);
  EXPECT_EQ(Mapping(from, to, {0.1}).unmapped(), 0u);
  SurfaceMesh cloud;
  cloud.points = {{0.5, 0.5, 0}, {0, 0, 9}};
  EXPECT_EQ(Mapping(cloud, to, {0.1}).unmapped(), 1u);
}

TEST(ConservativeMapping, RefusesWhatItCannotMeasure) {
  const auto to = flat(FaceKind::quad4, 2, 2);
  auto from = flat(FaceKind::triangle3, 2, 2);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double limit : {0.0, -1.0, nan})
    EXPECT_THROW(Mapping(from, to, {limit}), std::invalid_argument);
  const Mapping mapping(from, to, {0.1});
  std::vector<Vec3> short_by_one(to.points.size() - 1), received(to.points.size());
  const std::vector<Vec3> forces(from.points.size());
  EXPECT_THROW(mapping.forces(forces, short_by_one), std::invalid_argument);
  EXPECT_THROW(mapping.forces(short_by_one, received), std::invalid_argument);
  from.points[0].x() = nan;
  EXPECT_THROW(Mapping(from, to, {0.1}), std::invalid_argument);
  EXPECT_EQ(Mapping(flat(FaceKind::triangle3, 2, 2), SurfaceMesh{}, {0.1}).unmapped(), 9u);
}

}  // namespace
}  // namespace acopla::coupler
