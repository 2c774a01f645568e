// How exactly the mappings between cubes of unlike meshes carry fields and loads, and how far explicit coupling is stable, as JSON lines:
//   mapping_accuracy fields | loads | limits
#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <string>

#include "coupler/mapping/balance.h"
#include "coupler/mapping/mapping.h"
#include "coupler/stability.h"

namespace {

using namespace acopla;
using coupler::MappingKind;
using geometry::FaceKind;
using geometry::SurfaceMesh;
using geometry::Vec3;

/// The unit cube's surface, n × n cells a side, as triangles or quads. Sides share positions, not nodes.
SurfaceMesh cube(std::uint32_t n, bool triangles) {
  SurfaceMesh mesh;
  for (int axis = 0; axis < 3; ++axis)
    for (const double level : {0.0, 1.0}) {
      const auto first = static_cast<std::uint32_t>(mesh.points.size());
      for (std::uint32_t j = 0; j <= n; ++j)
        for (std::uint32_t i = 0; i <= n; ++i) {
          Vec3 point;
          point[axis] = level, point[(axis + 1) % 3] = double(i) / n, point[(axis + 2) % 3] = double(j) / n;
          mesh.points.push_back(point);
        }
      for (std::uint32_t j = 0; j < n; ++j)
        for (std::uint32_t i = 0; i < n; ++i) {
          const std::uint32_t a = first + j * (n + 1) + i, b = a + 1, c = b + n + 1, d = a + n + 1;
          if (triangles) {
            mesh.add_face(FaceKind::triangle3, std::array{a, b, c});
            mesh.add_face(FaceKind::triangle3, std::array{a, c, d});
          } else {
            mesh.add_face(FaceKind::quad4, std::array{a, b, c, d});
          }
        }
    }
  return mesh;
}

/// Franke's function (1982) of x and y, which z stretches.
double franke(const Vec3& p) {
  const double x = 9 * p.x(), y = 9 * p.y();
  return (1 + 0.5 * p.z()) * (0.75 * std::exp(-((x - 2) * (x - 2) + (y - 2) * (y - 2)) / 4) + 0.75 * std::exp(-(x + 1) * (x + 1) / 49 - (y + 1) / 10) +
                              0.5 * std::exp(-((x - 7) * (x - 7) + (y - 3) * (y - 3)) / 4) - 0.2 * std::exp(-(x - 4) * (x - 4) - (y - 7) * (y - 7)));
}

const char* name_of(MappingKind kind) { return kind == MappingKind::overlap ? "overlap" : kind == MappingKind::nearest ? "nearest" : "conservative"; }
constexpr std::array kinds{MappingKind::conservative, MappingKind::overlap, MappingKind::nearest};

void fields() {
  for (const auto kind : kinds)
    for (const std::uint32_t n : {16u, 32u, 64u}) {
      const auto from = cube(n, true), to = cube(n * 5 / 8, false);
      const coupler::Mapping mapping(from, to, {0.1, kind});
      std::vector<Vec3> given(to.points.size()), carried(from.points.size());
      for (std::size_t k = 0; k < given.size(); ++k) given[k] = Vec3::Constant(franke(to.points[k]));
      mapping.conjugate_values(given, carried);
      double square = 0, size = 0;
      for (std::size_t k = 0; k < carried.size(); ++k) {
        const double exact = franke(from.points[k]);
        square += std::pow(carried[k].x() - exact, 2);
        size += exact * exact;
      }
      fmt::print("{{\"mapping\": \"{}\", \"cells\": {}, \"error\": {:.6g}}}\n", name_of(kind), n, std::sqrt(square / size));
    }
}

void loads() {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> any(-1, 1);
  for (const auto kind : kinds) {
    double force = 0, moment = 0;
    for (int frame = 0; frame < 5; ++frame) {
      auto from = cube(24, true), to = cube(17, false);
      const Eigen::Matrix3d turn = Eigen::AngleAxisd(1.3 * frame, Vec3(any(random), any(random), any(random)).normalized()).toRotationMatrix();
      const Vec3 shift = 3.0 * frame * Vec3(any(random), any(random), any(random));
      for (auto* mesh : {&from, &to})
        for (auto& point : mesh->points) point = turn * point + shift;
      std::vector<Vec3> sent(from.points.size()), received(to.points.size());
      for (auto& f : sent) f = Vec3(any(random), any(random), any(random));
      coupler::Mapping(from, to, {0.1, kind}).forces(sent, received);
      const auto loss = coupler::loss(coupler::resultant(from.points, sent, shift), coupler::resultant(to.points, received, shift));
      force = std::max(force, loss.force);
      moment = std::max(moment, loss.moment);
    }
    fmt::print("{{\"mapping\": \"{}\", \"force\": {:.6g}, \"moment\": {:.6g}}}\n", name_of(kind), force, moment);
  }
}

/// The turn of a contact in a window, ω_c Δt with ω_c² = k/M, up to which nothing grows by more than a thousandth a window.
void limits() {
  for (const double particle : {1e-4, 1e-3, 1e-2, 0.1, 1.0, 10.0, 1e3})
    for (const double ratio : {0.0, 0.02, 0.05, 0.1, 0.2, 0.33, 0.6}) {
      const auto first = [&](const auto& growth) {
        for (double turn = 0.01; turn < 4; turn += 0.01) {
          const double stiffness = turn * turn;
          if (growth({stiffness, 2 * ratio * std::sqrt(stiffness * particle / (1 + particle)), particle, 1}, 1.0) > 1e-3) return turn;
        }
        return 4.0;
      };
      fmt::print("{{\"particle\": {}, \"ratio\": {}, \"free\": {:.2f}, \"held\": {:.2f}}}\n", particle, ratio, first(coupler::growth_of_free_particle),
                 first(coupler::growth_of_held_particle));
    }
}

}  // namespace

int main(int argc, char** argv) {
  const std::string mode = argc > 1 ? argv[1] : "";
  if (mode == "fields") fields();
  else if (mode == "loads") loads();
  else if (mode == "limits") limits();
  else {
    fmt::print(stderr, "mapping_accuracy fields | loads | limits\n");
    return 2;
  }
  return 0;
}
