// Time to find the partners of n points on a surface of m triangles, by buckets and by looking at
// every face, on a closed torus (hollow, so that a dense grid over its bounding box would be
// wasteful) with points slightly off it. One JSON object a line. `bucket_seconds` is building the
// buckets and finding all partners: the least of several repeats, which together take at least 0.6
// s. `exhaustive_seconds` is for all n points; above 1e4 it is measured on `sampled` random points
// and scaled by n / sampled. `--quick` leaves out 1e3.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <numbers>
#include <numeric>
#include <random>
#include <vector>

#include "coupler/mapping/search.h"

namespace {

using acopla::coupler::Partner;
using acopla::coupler::PartnerSearch;
using acopla::geometry::FaceKind;
using acopla::geometry::SurfaceMesh;
using acopla::geometry::Vec3;
using Clock = std::chrono::steady_clock;

constexpr double ring = 1, tube = 0.4;           // radii [m]
constexpr double displaced = 1e-3, limit = 0.1;  // [m]

Vec3 on_torus(double along, double around, double radius) {
  const double r = ring + radius * std::cos(around);
  return {r * std::cos(along), r * std::sin(along), radius * std::sin(around)};
}

SurfaceMesh torus(std::uint32_t along, std::uint32_t around) {
  constexpr double turn = 2 * std::numbers::pi;
  SurfaceMesh mesh;
  for (std::uint32_t i = 0; i < along; ++i)
    for (std::uint32_t j = 0; j < around; ++j)
      mesh.points.push_back(on_torus(turn * i / along, turn * j / around, tube));
  const auto node = [&](std::uint32_t i, std::uint32_t j) {
    return (i % along) * around + j % around;
  };
  for (std::uint32_t i = 0; i < along; ++i)
    for (std::uint32_t j = 0; j < around; ++j) {
      mesh.add_face(FaceKind::triangle3,
                    std::array{node(i, j), node(i + 1, j), node(i + 1, j + 1)});
      mesh.add_face(FaceKind::triangle3,
                    std::array{node(i, j), node(i + 1, j + 1), node(i, j + 1)});
    }
  return mesh;
}

/// The middles of the triangles, in the order of the mesh as the points of a real surface are,
/// moved at random.
std::vector<Vec3> points_near(const SurfaceMesh& mesh, std::mt19937_64& random) {
  std::uniform_real_distribution<double> off(-displaced, displaced);
  std::vector<Vec3> points(mesh.face_count(), Vec3::Zero());
  for (std::size_t face = 0; face < points.size(); ++face) {
    for (const auto node : mesh.nodes(face)) points[face] += mesh.points[node] / 3;
    points[face] += Vec3(off(random), off(random), off(random));
  }
  return points;
}

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

constexpr std::uint32_t nobody = std::numeric_limits<std::uint32_t>::max();

std::uint32_t face_of(const std::optional<Partner>& partner) {
  return partner ? partner->face : nobody;
}

/// @return whether buckets and exhaustive search agree on every point looked at
bool measure(std::uint32_t along, std::uint32_t around) {
  const auto mesh = torus(along, around);
  const std::size_t n = mesh.face_count();
  std::mt19937_64 random(2011);
  std::vector<Vec3> points;

  std::vector<std::uint32_t> partners(n);
  double bucket = std::numeric_limits<double>::infinity(), total = 0;
  for (int repeat = 0; repeat < 3 || total < 0.6; ++repeat) {
    // New points every time: a branch predictor learns a thousand fixed ones by heart.
    points = points_near(mesh, random);
    const auto start = Clock::now();
    const PartnerSearch search(mesh);
    for (std::size_t k = 0; k < n; ++k) partners[k] = face_of(search.nearest(points[k], limit));
    const double seconds = seconds_since(start);
    bucket = std::min(bucket, seconds);
    total += seconds;
  }

  std::vector<std::size_t> sample(n);
  std::iota(sample.begin(), sample.end(), std::size_t{0});
  if (n > 10000) {
    std::shuffle(sample.begin(), sample.end(), random);
    sample.resize(200);
  }
  const PartnerSearch search(mesh);
  std::vector<std::uint32_t> oracle(sample.size());
  const auto start = Clock::now();
  for (std::size_t k = 0; k < sample.size(); ++k)
    oracle[k] = face_of(search.nearest_exhaustive(points[sample[k]], limit));
  const double exhaustive =
      seconds_since(start) * static_cast<double>(n) / static_cast<double>(sample.size());
  bool same = true;
  for (std::size_t k = 0; k < sample.size(); ++k)
    same = same && oracle[k] == partners[sample[k]] && oracle[k] != nobody;

  std::printf(
      "{\"points\":%zu,\"triangles\":%zu,\"bucket_seconds\":%.6g,\"exhaustive_seconds\":%.6g,"
      "\"sampled\":%zu,"
      "\"same_partners\":%s}\n",
      n, mesh.face_count(), bucket, exhaustive, sample.size(), same ? "true" : "false");
  std::fflush(stdout);
  return same;
}

}  // namespace

int main(int argc, char** argv) {
  bool quick = false;
  for (int k = 1; k < argc; ++k) {
    if (std::strcmp(argv[k], "--quick") != 0) {
      std::fprintf(stderr, "usage: %s [--quick]\n", argv[0]);
      return 2;
    }
    quick = true;
  }
  bool same = quick || measure(25, 20);  // a thousand points fit into the first-level cache, which is not how a search grows
  same = measure(100, 50) && same;
  same = measure(250, 200) && same;
  return same ? 0 : 1;
}
