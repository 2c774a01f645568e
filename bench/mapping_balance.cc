// Force and moment before and after the conservative mapping, for random forces on surfaces that do not match: one JSON
// object a line. The drums do not even coincide: a 32-gon in a 48-gon, so every force arrives with its couple.
#include <cmath>
#include <cstdio>
#include <random>

#include "coupler/mapping/balance.h"
#include "coupler/mapping/mapping.h"

namespace {

using namespace acopla;
using geometry::FaceKind;
using geometry::SurfaceMesh;
using geometry::Vec3;

/// Shell of a drum about z of radius 0.5 m and length 0.8 m: `sides` flat sides, `rings` rows, as triangles or quads.
SurfaceMesh drum(std::uint32_t sides, std::uint32_t rings, bool triangles) {
  SurfaceMesh mesh;
  for (std::uint32_t r = 0; r <= rings; ++r)
    for (std::uint32_t s = 0; s < sides; ++s) {
      const double angle = 2 * M_PI * s / sides;
      mesh.points.emplace_back(0.5 * std::cos(angle), 0.5 * std::sin(angle), 0.8 * r / rings);
    }
  for (std::uint32_t r = 0; r < rings; ++r)
    for (std::uint32_t s = 0; s < sides; ++s) {
      const std::uint32_t a = r * sides + s, b = r * sides + (s + 1) % sides, c = b + sides, d = a + sides;
      if (triangles) {
        mesh.add_face(FaceKind::triangle3, std::array{a, b, c});
        mesh.add_face(FaceKind::triangle3, std::array{a, c, d});
      } else {
        mesh.add_face(FaceKind::quad4, std::array{a, b, c, d});
      }
    }
  return mesh;
}

}  // namespace

int main() {
  const auto from = drum(32, 9, true), to = drum(48, 13, false);
  const coupler::Mapping mapping(from, to, {0.05});
  std::mt19937_64 random(2011);
  std::uniform_real_distribution<double> component(-1, 1);
  double force_loss = 0, moment_loss = 0;
  for (int trial = 0; trial < 100; ++trial) {
    std::vector<Vec3> sent(from.points.size()), received(to.points.size());
    for (auto& force : sent) force = Vec3(component(random), component(random), component(random));
    mapping.forces(sent, received);
    const auto about = from.centroid();
    const auto lost = coupler::loss(coupler::resultant(from.points, sent, about), coupler::resultant(to.points, received, about));
    force_loss = std::max(force_loss, lost.force);
    moment_loss = std::max(moment_loss, lost.moment);
  }
  std::printf("{\"case\":\"32-gon drum on a 48-gon drum\",\"force_loss\":%.3g,\"moment_loss\":%.3g,\"unmapped\":%zu,\"worst_distance\":%.4g}\n",
              force_loss, moment_loss, mapping.unmapped(), mapping.worst_distance());
  return 0;
}
