#include "fem/grid.h"

#include <algorithm>
#include <map>

namespace acopla::fem {
namespace {

/// Corners of a cell by bits: bit d set is the upper one along direction d.
using Corners = std::vector<unsigned>;

/// The cells that a cell of the grid is made of, in gmsh's order.
std::vector<Corners> pieces(const Grid& grid) {
  if (grid.dimension == 2)
    return grid.simplices ? std::vector<Corners>{{0, 1, 3}, {0, 3, 2}}
                          : std::vector<Corners>{{0, 1, 3, 2}};
  if (!grid.simplices) return {{0, 1, 3, 2, 4, 5, 7, 6}};
  // Around the diagonal from corner 0 to corner 7.
  return {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7}, {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}};
}

/// Corners of the faces of a piece that lie on a side of the grid's cell.
std::vector<Corners> faces_on(const Grid& grid, const Corners& piece, int side) {
  const auto lies_on = [&](unsigned corner) {
    return (corner >> (side / 2) & 1u) == static_cast<unsigned>(side % 2);
  };
  Corners on;
  std::copy_if(piece.begin(), piece.end(), std::back_inserter(on), lies_on);
  const std::size_t whole = grid.dimension == 2 ? 2 : grid.simplices ? 3 : 4;
  return on.size() == whole ? std::vector<Corners>{on} : std::vector<Corners>{};
}

class Builder {
 public:
  explicit Builder(const Grid& grid) : grid_(grid) {}

  MeshSource build() {
    result_.name = grid_.name;
    auto& mesh = result_.mesh;
    mesh.dimension = grid_.dimension;
    mesh.simplex = grid_.simplices;
    result_.place = grid_.place;
    solid_ = group("solid", grid_.dimension);
    const int depth = grid_.dimension == 2 ? 1 : grid_.cells[2];
    for (int k = 0; k < depth; ++k)
      for (int j = 0; j < grid_.cells[1]; ++j)
        for (int i = 0; i < grid_.cells[0]; ++i)
          if (grid_.keep({i, j, k})) add_cell({i, j, k});
    for (auto& [id, faces] : mesh.boundaries) std::sort(faces.begin(), faces.end());
    return std::move(result_);
  }

 private:
  int group(const std::string& name, int dimension) {
    auto& groups = result_.groups;
    const auto found = std::find_if(groups.begin(), groups.end(),
                                    [&](const PhysicalGroup& g) { return g.name == name; });
    if (found != groups.end()) return found->id;
    groups.push_back({name, dimension, static_cast<int>(groups.size()) + 1});
    return groups.back().id;
  }

  GridIndex corner_index(const GridIndex& cell, unsigned corner) const {
    GridIndex index = cell;
    for (std::size_t d = 0; d < 3; ++d) index[d] += static_cast<int>(corner >> d & 1u);
    return index;
  }
  std::uint32_t point(GridIndex index) {
    if (grid_.closed) index[1] %= grid_.cells[1];
    if (grid_.joined) index = grid_.joined(index);
    const auto [found, added] =
        points_.emplace(index, static_cast<std::uint32_t>(result_.mesh.points.size()));
    if (added) {
      const auto coordinates = grid_.corner(index);
      result_.mesh.points.push_back(grid_.place ? grid_.place(coordinates) : coordinates);
    }
    return found->second;
  }

  void add_cell(const GridIndex& cell) {
    auto& mesh = result_.mesh;
    for (const auto& piece : pieces(grid_)) {
      std::array<std::uint32_t, 8> corners{};
      std::array<geometry::Vec3, 8> parameters;
      parameters.fill(geometry::Vec3::Zero());
      for (std::size_t c = 0; c < piece.size(); ++c) {
        const auto index = corner_index(cell, piece[c]);
        corners[c] = point(index);
        parameters[c] = grid_.corner(index);
      }
      mesh.solids[solid_].push_back(static_cast<std::uint32_t>(mesh.cells.size()));
      mesh.cells.push_back(corners);
      if (grid_.place) result_.parameters.push_back(parameters);
    }
    for (int side = 0; side < 2 * grid_.dimension; ++side)
      if (is_boundary(cell, side)) add_side(cell, side);
  }

  bool is_boundary(GridIndex cell, int side) const {
    const auto d = static_cast<std::size_t>(side / 2);
    cell[d] += side % 2 ? 1 : -1;
    if (grid_.closed && d == 1) cell[1] = (cell[1] + grid_.cells[1]) % grid_.cells[1];
    return cell[d] < 0 || cell[d] >= grid_.cells[d] || !grid_.keep(cell);
  }

  void add_side(const GridIndex& cell, int side) {
    for (const auto& name : grid_.sides(side, cell)) {
      const int id = group(name, grid_.dimension - 1);
      for (const auto& piece : pieces(grid_))
        for (const auto& face : faces_on(grid_, piece, side)) {
          FaceKey key;
          key.fill(no_corner);
          for (std::size_t c = 0; c < face.size(); ++c) key[c] = point(corner_index(cell, face[c]));
          std::sort(key.begin(), key.end());
          result_.mesh.boundaries[id].push_back(key);
        }
    }
  }

  const Grid& grid_;
  MeshSource result_;
  std::map<GridIndex, std::uint32_t> points_;
  int solid_ = 0;
};

}  // namespace

MeshSource build(const Grid& grid) { return Builder(grid).build(); }

std::vector<std::string> side_name(int side, const GridIndex&) {
  static constexpr const char* names[] = {"x0", "x1", "y0", "y1", "z0", "z1"};
  return {names[side]};
}

}  // namespace acopla::fem
