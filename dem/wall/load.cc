#include "dem/wall/load.h"

#include <algorithm>

#include <array>

#include "dem/wall/wall_set.h"
#include "geometry/couple.h"

namespace acopla::dem {
namespace {

void clear(WallForces& forces) {
  for (auto& wall : forces.walls) wall = {};
  for (auto& force : forces.vertex) force.setZero();
  for (auto& couple : forces.couple) couple.setZero();
}

void add(WallForces& sum, const WallForces& forces, double factor) {
  for (std::size_t w = 0; w < sum.walls.size(); ++w) {
    sum.walls[w].force += factor * forces.walls[w].force;
    sum.walls[w].torque += factor * forces.walls[w].torque;
    sum.walls[w].power += factor * forces.walls[w].power;
  }
  for (std::size_t v = 0; v < sum.vertex.size(); ++v) sum.vertex[v] += factor * forces.vertex[v];
  for (std::size_t f = 0; f < sum.couple.size(); ++f) sum.couple[f] += factor * forces.couple[f];
}

}  // namespace

WallLoadSum::WallLoadSum(const WallSet& walls, std::size_t partitions) {
  WallForces empty;
  empty.walls.resize(walls.walls().size());
  empty.vertex.assign(walls.sent_vertices(), Vec3::Zero());
  empty.couple.assign(walls.sent_facets(), Vec3::Zero());
  sum_.assign(partitions, empty);
  edge_ = sum_;
}

void WallLoadSum::begin() {
  at_end_ = false;
  for (std::size_t p = 0; p < sum_.size(); ++p) {
    clear(sum_[p]);
    add(sum_[p], edge_[p], 0.5);
  }
}

void WallLoadSum::begin_last() {
  at_end_ = true;
  for (auto& forces : edge_) clear(forces);
}

WallLoad WallLoadSum::finish(const WallSet& walls, double steps) {
  WallForces total = edge_.front();
  clear(total);
  for (std::size_t p = 0; p < sum_.size(); ++p) {
    add(total, sum_[p], 1 / steps);
    add(total, edge_[p], 0.5 / steps);
  }
  WallLoad load;
  load.walls = std::move(total.walls);
  load.vertex_force.resize(load.walls.size());
  for (std::size_t w = 0; w < load.walls.size(); ++w) {
    if (!walls.sends(w)) continue;
    auto& forces = load.vertex_force[w];
    const auto first = walls.first_vertex(w), last = walls.first_vertex(w + 1);
    const auto begin = total.vertex.begin() + static_cast<std::ptrdiff_t>(walls.sent_vertex(w, first));
    forces.assign(begin, begin + (last - first));
    for (auto f = walls.first_facet(w); f < walls.first_facet(w + 1); ++f) {
      const Vec3& couple = total.couple[walls.sent_facet(w, f)];
      if (couple.isZero(0)) continue;
      const auto size = walls.vertices_of(f);
      std::array<Vec3, 3> points, carried;
      for (std::size_t n = 0; n < size; ++n) points[n] = walls.body_vertex(walls.facet(f)[n]);
      if (!geometry::couple_forces({points.data(), size}, couple, {carried.data(), size})) ++load.couples_lost;
      for (std::size_t n = 0; n < size; ++n) forces[walls.facet(f)[n] - first] += carried[n];
    }
  }
  return load;
}

void WallLoad::add(const WallLoad& other, double share) {
  if (walls.empty()) {
    walls.resize(other.walls.size());
    vertex_force.resize(other.vertex_force.size());
    for (std::size_t w = 0; w < vertex_force.size(); ++w) vertex_force[w].assign(other.vertex_force[w].size(), Vec3::Zero());
  }
  for (std::size_t w = 0; w < walls.size(); ++w) {
    walls[w].force += share * other.walls[w].force;
    walls[w].torque += share * other.walls[w].torque;
    walls[w].power += share * other.walls[w].power;
    for (std::size_t v = 0; v < vertex_force[w].size(); ++v) vertex_force[w][v] += share * other.vertex_force[w][v];
  }
  couples_lost = std::max(couples_lost, other.couples_lost);
}

}  // namespace acopla::dem
