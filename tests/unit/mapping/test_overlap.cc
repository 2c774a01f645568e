#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>

#include "coupler/mapping/balance.h"
#include "coupler/mapping/mapping.h"
#include "coupler/mapping/share.h"
#include "meshes.h"

namespace acopla::coupler {
namespace {

using namespace testing;

std::vector<Vec3> mapped(const Mapping& mapping, const std::vector<Vec3>& forces) {
  std::vector<Vec3> received(mapping.to_count());
  mapping.forces(forces, received);
  return received;
}

void expect_conserved(const SurfaceMesh& from, const SurfaceMesh& to, const MappingOptions& options, const char* what, bool in_plane = false) {
  const Mapping mapping(from, to, options);
  ASSERT_EQ(mapping.unmapped(), 0u) << what;
  ASSERT_EQ(mapping.couples_lost(), 0u) << what;
  const auto forces = random_vectors(from.points.size(), 16, in_plane);
  const auto sent = resultant(from.points, forces, to.centroid()), received = resultant(to.points, mapped(mapping, forces), to.centroid());
  EXPECT_LT(loss(sent, received).force, 1e-12) << what;
  EXPECT_LT(loss(sent, received).moment, 1e-12) << what;
}

MappingOptions overlap(double max_distance) { return {max_distance, MappingKind::overlap}; }

const std::array linear_surface_kinds{FaceKind::triangle3, FaceKind::quad4};

TEST(OverlapMapping, UniformPressurePassesThePatchTestOnMeshesThatDoNotMatch) {
  for (const auto from_kind : linear_surface_kinds)
    for (const auto to_kind : surface_kinds)
      for (const auto& [nx, ny] : {std::pair{3, 4}, {7, 5}, {16, 13}}) {  // coarser, alike, finer than 6 × 5
        const auto from = flat(from_kind, nx, ny), to = flat(to_kind, 6, 5);
        const auto received = mapped(Mapping(from, to, overlap(1e-6)), uniform_pressure(from)), exact = uniform_pressure(to);
        for (std::size_t k = 0; k < exact.size(); ++k)
          ASSERT_NEAR(received[k].z(), exact[k].z(), 1e-14) << name_of(from_kind) << " to " << name_of(to_kind) << ", " << nx << " x " << ny;
      }
}

TEST(OverlapMapping, AndSoItDoesOnLinesInThePlane) {
  for (const auto to_kind : {FaceKind::line2, FaceKind::line3})
    for (const int n : {3, 7, 16}) {
      const auto from = flat(FaceKind::line2, n, 1), to = flat(to_kind, 6, 1);
      const auto turn = [](std::vector<Vec3> forces) {
        for (auto& force : forces) force = {0, force.z(), 0};  // a force in the plane
        return forces;
      };
      const auto received = mapped(Mapping(from, to, overlap(1e-6)), turn(uniform_pressure(from))), exact = turn(uniform_pressure(to));
      for (std::size_t k = 0; k < exact.size(); ++k) ASSERT_NEAR(received[k].y(), exact[k].y(), 1e-15) << name_of(to_kind) << ", " << n;
    }
}

TEST(OverlapMapping, TheNearestFaceWouldLeaveNodesUnderACoarseSurfaceWithoutLoad) {
  const auto from = flat(FaceKind::triangle3, 3, 4), to = flat(FaceKind::quad4, 24, 20);
  const auto unloaded = [&](const MappingOptions& options) {
    const auto received = mapped(Mapping(from, to, options), uniform_pressure(from));
    return std::count_if(received.begin(), received.end(), [](const Vec3& f) { return f.norm() == 0; });
  };
  EXPECT_GT(unloaded({1e-6}), 400);
  EXPECT_EQ(unloaded(overlap(1e-6)), 0);
}

TEST(OverlapMapping, KeepsForceAndMomentOfAnyLoads) {
  for (const auto from_kind : surface_kinds)
    for (const auto to_kind : surface_kinds) {
      expect_conserved(open_box(from_kind, 5), open_box(to_kind, 4), overlap(0.01), "box");
      expect_conserved(drum(from_kind, 48, 5), drum(to_kind, 20, 3), overlap(0.05), "drum");
      expect_conserved(skew(from_kind, 5, 7), skew(to_kind, 6, 4), overlap(1e-6), "skew");
    }
  for (const auto from_kind : {FaceKind::line2, FaceKind::line3})
    for (const auto to_kind : {FaceKind::line2, FaceKind::line3}) expect_conserved(ring(from_kind, 48, 0.5), ring(to_kind, 20, 0.5), overlap(0.05), "ring", true);
}

TEST(OverlapMapping, ResultsTurnWithTheFrame) {
  const Eigen::Matrix3d rotation = (Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized())).toRotationMatrix();
  const auto from = drum(FaceKind::triangle3, 30, 4), to = drum(FaceKind::quad9, 14, 3);
  const auto turned = [&](SurfaceMesh mesh) {
    for (auto& point : mesh.points) point = rotation * point + Vec3(3, -2, 5);
    return mesh;
  };
  auto forces = random_vectors(from.points.size(), 3, false);
  const auto here = mapped(Mapping(from, to, overlap(0.05)), forces);
  for (auto& force : forces) force = rotation * force;
  const auto there = mapped(Mapping(turned(from), turned(to), overlap(0.05)), forces);
  for (std::size_t k = 0; k < here.size(); ++k) EXPECT_LT((rotation * here[k] - there[k]).norm(), 1e-11);
}

TEST(OverlapMapping, TheOtherSideOfAPlateGetsNothing) {
  auto to = flat(FaceKind::quad4, 6, 5);
  const auto one_side = to.points.size();
  add_patch(to, FaceKind::quad4, 6, 5, [](double s, double t) { return Vec3(s, t, -0.1); });
  const auto from = flat(FaceKind::triangle3, 5, 4);
  const auto received = mapped(Mapping(from, to, overlap(1.0)), uniform_pressure(from));
  for (std::size_t k = one_side; k < received.size(); ++k) EXPECT_EQ(received[k].norm(), 0);
}

TEST(OverlapMapping, PointsOverNoFaceTakeTheNearest) {
  auto from = flat(FaceKind::triangle3, 4, 4), to = flat(FaceKind::quad4, 3, 3);
  for (auto& point : from.points) point.x() *= 2;  // half of it stands out
  for (auto* mesh : {&from, &to})
    for (auto& point : mesh->points) point.z() = 1;  // at 0 the problem would be plane
  const Mapping mapping(from, to, overlap(2.0));
  EXPECT_EQ(mapping.unmapped(), 0u);
  EXPECT_EQ(mapping.uncovered(), 10u);  // two of five columns; that at x = 1 has faces on its inner side
  expect_conserved(from, to, overlap(2.0), "half over nothing");
  EXPECT_EQ(Mapping(from, to, overlap(0.6)).unmapped(), 5u);
}

TEST(OverlapMapping, TheMotionIsItsTranspose) {
  const auto from = drum(FaceKind::triangle3, 30, 4), to = drum(FaceKind::quad9, 14, 3);
  const Mapping mapping(from, to, overlap(0.05));
  const auto forces = random_vectors(from.points.size(), 3, false), motion = random_vectors(to.points.size(), 4, false);
  std::vector<Vec3> moved(from.points.size());
  mapping.conjugate_values(motion, moved);
  const auto received = mapped(mapping, forces);
  double here = 0, there = 0;
  for (std::size_t k = 0; k < forces.size(); ++k) there += forces[k].dot(moved[k]);
  for (std::size_t k = 0; k < received.size(); ++k) here += received[k].dot(motion[k]);
  EXPECT_NEAR(here, there, 1e-12 * forces.size());
}

TEST(NearestMapping, KeepsForceAndMomentOnAReceiverWithoutFaces) {
  const auto from = drum(FaceKind::triangle3, 30, 4);
  SurfaceMesh cloud;
  cloud.points = drum(FaceKind::quad4, 14, 3).points;
  expect_conserved(from, cloud, {1.0, MappingKind::nearest}, "cloud");
  const auto line = ring(FaceKind::line2, 48, 0.5);
  SurfaceMesh around;
  around.points = ring(FaceKind::line2, 20, 0.5).points;
  expect_conserved(line, around, {1.0, MappingKind::nearest}, "in the plane", true);
}

TEST(NearestMapping, EqualsTheSearchThroughAll) {
  SurfaceMesh cloud;
  for (const auto& p : random_vectors(500, 8, false)) cloud.points.push_back(p);
  const auto from = drum(FaceKind::triangle3, 30, 4);
  const Mapping mapping(from, cloud, {10.0, MappingKind::nearest});
  std::vector<Vec3> positions(from.points.size());
  mapping.values(cloud.points, positions);
  for (std::size_t k = 0; k < positions.size(); ++k) {
    const auto nearest = std::min_element(cloud.points.begin(), cloud.points.end(), [&](const Vec3& a, const Vec3& b) { return (a - from.points[k]).norm() < (b - from.points[k]).norm(); });
    EXPECT_EQ(positions[k], *nearest);
  }
  EXPECT_GT(Mapping(from, cloud, {1e-3, MappingKind::nearest}).unmapped(), 100u);
}

TEST(SharedSurface, EachPointLoadsOneOfTheReceivers) {
  // Two plates side by side under one surface.
  const auto from = flat(FaceKind::triangle3, 9, 8);
  SurfaceMesh left, right;
  add_patch(left, FaceKind::quad4, 4, 4, [](double s, double t) { return Vec3(0.5 * s, t, 0); });
  add_patch(right, FaceKind::quad9, 3, 3, [](double s, double t) { return Vec3(0.5 + 0.5 * s, t, 0); });
  const SurfaceMesh* plates[] = {&left, &right};
  const auto shares = share_points(from, plates, 1e-3);
  for (std::size_t k = 0; k < from.points.size(); ++k) {
    EXPECT_EQ(shares[0][k] + shares[1][k], 1);
    EXPECT_EQ(shares[0][k], from.points[k].x() <= 0.5 ? 1 : 0);
  }
  for (const auto kind : {MappingKind::conservative, MappingKind::overlap}) {
    const auto forces = random_vectors(from.points.size(), 16, false);
    Vec3 sent = Vec3::Zero(), received = Vec3::Zero();
    for (const auto& force : forces) sent += force;
    for (int k = 0; k < 2; ++k)
      for (const auto& force : mapped(Mapping(from, *plates[k], {1e-3, kind, shares[static_cast<std::size_t>(k)]}), forces)) received += force;
    EXPECT_LT((sent - received).norm(), 1e-12);
  }
}

TEST(SharedSurface, APointNearNobodyIsCountedOnce) {
  auto from = flat(FaceKind::triangle3, 2, 2);
  from.points.front().z() = 9;
  const auto left = flat(FaceKind::quad4, 1, 1), right = left;
  const SurfaceMesh* plates[] = {&left, &right};
  const auto shares = share_points(from, plates, 0.1);
  EXPECT_EQ(Mapping(from, left, {0.1, MappingKind::conservative, shares[0]}).unmapped(), 1u);
  EXPECT_EQ(Mapping(from, right, {0.1, MappingKind::conservative, shares[1]}).unmapped(), 0u);
}

}  // namespace
}  // namespace acopla::coupler
