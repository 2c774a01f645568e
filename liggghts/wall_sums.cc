#include "liggghts/wall_sums.h"

#include <fix_contact_property_atom.h>
#include <fmt/format.h>
#include <library.h>
#include <modify.h>

#include <Eigen/Geometry>
#include <stdexcept>

#include "geometry/couple.h"
#include "geometry/triangle.h"

namespace acopla::liggghts {
namespace {

using dem::Vec3;

LAMMPS_NS::FixContactPropertyAtom* contact_fix(LAMMPS_NS::LAMMPS* liggghts, const std::string& name) {
  auto* const fix = dynamic_cast<LAMMPS_NS::FixContactPropertyAtom*>(liggghts->modify->find_fix_id(name.c_str()));
  if (!fix) throw std::logic_error(fmt::format("LIGGGHTS keeps no {}", name));
  return fix;
}

void clear(WallForces& forces) {
  for (auto& wall : forces.walls) wall.fill(Vec3::Zero());
  for (auto& force : forces.vertex) force.setZero();
  for (auto& couple : forces.couple) couple.setZero();
}

void add(WallForces& sum, const WallForces& forces, double factor) {
  for (std::size_t w = 0; w < sum.walls.size(); ++w)
    for (int k = 0; k < 2; ++k) sum.walls[w][k] += factor * forces.walls[w][k];
  for (std::size_t v = 0; v < sum.vertex.size(); ++v) sum.vertex[v] += factor * forces.vertex[v];
  for (std::size_t t = 0; t < sum.couple.size(); ++t) sum.couple[t] += factor * forces.couple[t];
}

}  // namespace

WallSums::WallSums(LAMMPS_NS::LAMMPS* liggghts, const Deck& deck) : liggghts_(liggghts), deck_(deck) {
  std::size_t vertices = 0, triangles = 0;
  for (const auto& mesh : deck.meshes) {
    Vec3 mean = Vec3::Zero();
    for (const auto& point : mesh.points) mean += point / static_cast<double>(mesh.points.size());
    const auto number = places_.size();
    places_.push_back({contact_fix(liggghts, fmt::format("contactforces_mesh{}", number)), contact_fix(liggghts, fmt::format("contactforces_stress_mesh{}", number)),
                       vertices, triangles, mean});
    vertices += mesh.points.size();
    triangles += mesh.triangles.size();
  }
  now_.walls.resize(deck.meshes.size() + deck.planes.size());
  now_.vertex.resize(vertices);
  now_.couple.resize(triangles);
  clear(now_);
  sum_ = now_;
}

void WallSums::begin_at_rest() {
  clear(now_);
  collect(now_);
}

void WallSums::begin(std::uint64_t steps) {
  steps_ = steps;
  done_ = 0;
  clear(sum_);
  add(sum_, now_, 0.5);
}

void WallSums::add_step() {
  if (++done_ < steps_) return collect(sum_);
  begin_at_rest();
  add(sum_, now_, 0.5);
}

void WallSums::collect(WallForces& forces) const {
  for (std::size_t m = 0; m < deck_.meshes.size(); ++m) collect_mesh(m, forces);
  for (std::size_t p = 0; p < deck_.planes.size(); ++p) collect_plane(p, forces);
}

void WallSums::collect_mesh(std::size_t number, WallForces& forces) const {
  const auto& mesh = deck_.meshes[number];
  const auto& place = places_[number];
  const auto count = *static_cast<int*>(lammps_extract_global(liggghts_, "nlocal"));
  const auto* const* const x = static_cast<double**>(lammps_extract_atom(liggghts_, "x"));
  for (int i = 0; i < count; ++i)
    for (int k = 0; k < place.forces->get_npartners(i); ++k) {
      const int triangle = place.forces->partner(i, k);
      const int same = place.points->has_partner(i, triangle);
      if (same < 0) throw std::logic_error("LIGGGHTS keeps a force without its point of contact");
      const Eigen::Map<const Vec3> force(place.forces->contacthistory(i, k)), torque(place.forces->contacthistory(i, k) + 3);
      const Eigen::Map<const Vec3> back(place.points->contacthistory(i, same) + 3), centre(x[i]);  // `back`: from the point to the centre
      const auto& nodes = mesh.triangles.at(static_cast<std::size_t>(triangle));
      const auto foot = geometry::nearest_on_triangle(centre - back, mesh.points[nodes[0]], mesh.points[nodes[1]], mesh.points[nodes[2]]);
      // What acts on the wall is what acts on the particle, with the sign turned: force, and moment about any point.
      for (int n = 0; n < 3; ++n) forces.vertex[place.first_vertex + nodes[n]] -= foot.weights[n] * force;
      forces.couple[place.first_triangle + static_cast<std::size_t>(triangle)] -= (centre - foot.point).cross(force) + torque;
      forces.walls[number][0] -= force;
      forces.walls[number][1] -= (centre - place.reference).cross(force) + torque;
    }
}

void WallSums::collect_plane(std::size_t number, WallForces& forces) const {
  const auto name = fmt::format("force_plane{}", number);
  const auto* const* const on_particles = static_cast<double**>(lammps_extract_fix(liggghts_, name.c_str(), 1, 2, 0, 0));
  if (!on_particles) throw std::logic_error(fmt::format("LIGGGHTS keeps no {}", name));
  const auto count = *static_cast<int*>(lammps_extract_global(liggghts_, "nlocal"));
  for (int i = 0; i < count; ++i) forces.walls[deck_.meshes.size() + number][0] -= Eigen::Map<const Vec3>(on_particles[i]);
}

std::vector<double> WallSums::mean() const {
  std::vector<double> numbers;
  numbers.reserve(6 * sum_.walls.size() + 3 * (sum_.vertex.size() + sum_.couple.size()));
  const auto append = [&](const Vec3& value) {
    for (int d = 0; d < 3; ++d) numbers.push_back(value[d] / static_cast<double>(steps_));
  };
  for (const auto& wall : sum_.walls) {
    append(wall[0]);
    append(wall[1]);
  }
  for (const auto& force : sum_.vertex) append(force);
  for (const auto& couple : sum_.couple) append(couple);
  return numbers;
}

std::vector<std::vector<Vec3>> WallSums::on_vertices(const Deck& deck, const std::vector<double>& mean, std::size_t& lost) {
  std::vector<std::vector<Vec3>> forces;
  const auto* next = mean.data() + 6 * (deck.meshes.size() + deck.planes.size());
  const auto take = [&] {
    const Vec3 value(next[0], next[1], next[2]);
    next += 3;
    return value;
  };
  for (const auto& mesh : deck.meshes) {
    auto& own = forces.emplace_back(mesh.points.size());
    for (auto& force : own) force = take();
  }
  for (std::size_t m = 0; m < deck.meshes.size(); ++m)
    for (const auto& nodes : deck.meshes[m].triangles) {
      const Vec3 couple = take();
      if (couple.isZero(0)) continue;
      std::array<Vec3, 3> points, carried;
      for (int n = 0; n < 3; ++n) points[n] = deck.meshes[m].points[nodes[n]];
      if (!geometry::couple_forces(points, couple, carried)) ++lost;
      for (int n = 0; n < 3; ++n) forces[m][nodes[n]] += carried[n];
    }
  return forces;
}

}  // namespace acopla::liggghts
