#include "fem/shapes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "fem/grid.h"

namespace acopla::fem {
namespace {

using geometry::Vec3;
constexpr double degree = 3.14159265358979323846 / 180;

/// Numbers of cells along each direction.
GridIndex read_cells(const io::Table& table, std::size_t count) {
  const auto numbers = table.numbers("cells");
  if (numbers.size() != count)
    table.fail("cells", fmt::format("needs {} whole numbers, e.g. {}.", count,
                                    count == 2 ? "[20, 2]" : "[20, 2, 2]"));
  GridIndex cells{1, 1, 1};
  for (std::size_t d = 0; d < count; ++d) {
    if (numbers[d] != std::floor(numbers[d]) || numbers[d] < 1 || numbers[d] > 1e6)
      table.fail("cells",
                 fmt::format("has {:.6g}; a number of cells is a whole number of at least 1.",
                             numbers[d]));
    cells[d] = static_cast<int>(numbers[d]);
  }
  return cells;
}

Vec3 read_size(const io::Table& table, const char* key, int dimension) {
  const Vec3 size = table.vector(key, dimension);
  for (int d = 0; d < dimension; ++d)
    if (!(size[d] > 0))
      table.fail(key, fmt::format("has {:.6g} m; lengths are positive.", size[d]));
  return size;
}

/// Equal spacing: corner i of n along a length.
Vec3 spaced(const GridIndex& index, const GridIndex& cells, const Vec3& size, int dimension) {
  Vec3 point = Vec3::Zero();
  for (int d = 0; d < dimension; ++d) {
    const auto c = static_cast<std::size_t>(d);
    point[d] = size[d] * index[c] / cells[c];
  }
  return point;
}

Grid read_bar(const io::Table& table, int dimension) {
  Grid grid{.dimension = dimension,
            .cells = read_cells(table, static_cast<std::size_t>(dimension))};
  const Vec3 size = read_size(table, "size", dimension);
  const Vec3 origin = table.has("origin") ? table.vector("origin", dimension) : Vec3::Zero();
  grid.simplices = table.flag("simplices", false);
  grid.corner = [=, cells = grid.cells](const GridIndex& index) {
    return Vec3(origin + spaced(index, cells, size, dimension));
  };
  grid.sides = side_name;
  return grid;
}

Grid read_plate(const io::Table& table, int dimension) {
  if (dimension == 2) table.fail("is a shape in 3D; in 2D a bar has the same cells.");
  Grid grid = read_bar(table, dimension);
  grid.sides = [](int side, const GridIndex&) -> std::vector<std::string> {
    return {side == 5 ? "top" : side == 4 ? "bottom" : "edges"};
  };
  return grid;
}

/// An open box: its cavity is left out of a block.
Grid read_box(const io::Table& table, int dimension) {
  const Vec3 inner = read_size(table, "inner", dimension);
  const double wall = table.number("wall", io::positive);
  const auto inside = read_cells(table, static_cast<std::size_t>(dimension));
  const auto layers = static_cast<int>(table.integer("wall_cells", 1, 1000, 2));
  const Vec3 origin = table.has("origin") ? table.vector("origin", dimension) : Vec3::Zero();
  const auto up =
      static_cast<std::size_t>(dimension - 1);  // open at the top: of y in 2D, of z in 3D
  Grid grid{.dimension = dimension};
  for (std::size_t d = 0; d <= up; ++d) grid.cells[d] = inside[d] + (d == up ? layers : 2 * layers);
  grid.corner = [=](const GridIndex& index) {
    Vec3 point = origin;
    for (std::size_t d = 0; d <= up; ++d) {
      const int n = index[d] - layers;  // from the inside's lower face
      const int c = static_cast<int>(d);
      point[c] += n < 0            ? wall * n / layers
                  : n <= inside[d] ? inner[c] * n / inside[d]
                                   : inner[c] + wall * (n - inside[d]) / layers;
    }
    return point;
  };
  const auto in_cavity = [=](const GridIndex& cell) {
    for (std::size_t d = 0; d <= up; ++d)
      if (cell[d] < layers || cell[d] >= layers + inside[d]) return false;
    return true;
  };
  grid.keep = [=](const GridIndex& cell) { return !in_cavity(cell); };
  grid.sides = [=, cells = grid.cells](int side,
                                       const GridIndex& cell) -> std::vector<std::string> {
    const auto d = static_cast<std::size_t>(side / 2);
    const bool outermost = side % 2 ? cell[d] + 1 == cells[d] : cell[d] == 0;
    if (!outermost) return {"inside"};
    if (d == up) return {side % 2 ? "rim" : "base"};
    return {"outside"};
  };
  return grid;
}

Grid read_bracket(const io::Table& table, int dimension) {
  const auto legs = table.numbers("legs");
  const double width = table.number("width", io::positive);
  if (legs.size() != 2 || !(std::min(legs[0], legs[1]) > width))
    table.fail("legs", "needs two lengths [m] along x and y, each above the width.");
  const double depth = dimension == 3 ? table.number("depth", io::positive) : 0;
  const auto across = static_cast<int>(table.integer("cells", 1, 1000));
  Grid grid{.dimension = dimension};
  const auto along = [&](double leg) {
    return std::max(1, static_cast<int>(std::lround((leg - width) / width * across)));
  };
  const int nx = along(legs[0]), ny = along(legs[1]);
  grid.cells = {
      across + nx, across + ny,
      dimension == 3 ? std::max(1, static_cast<int>(std::lround(depth / width * across))) : 1};
  grid.corner = [=, nz = grid.cells[2]](const GridIndex& index) {
    const auto at = [&](int i, double leg, int count) {
      return i <= across ? width * i / across : width + (leg - width) * (i - across) / count;
    };
    return Vec3(at(index[0], legs[0], nx), at(index[1], legs[1], ny), depth * index[2] / nz);
  };
  grid.keep = [=](const GridIndex& cell) { return cell[0] < across || cell[1] < across; };
  grid.sides = [=, cells = grid.cells](int side,
                                       const GridIndex& cell) -> std::vector<std::string> {
    if (side >= 4) return {side == 4 ? "back" : "front"};
    if (side % 2 == 0) return {"outer"};
    const auto d = static_cast<std::size_t>(side / 2);
    return {cell[d] + 1 == cells[d] ? (d == 0 ? "x1" : "y1") : "inner"};
  };
  return grid;
}

/// Coordinates: radius, angle, height.
Grid read_annulus(const io::Table& table, int dimension) {
  Grid grid{.dimension = dimension,
            .cells = read_cells(table, static_cast<std::size_t>(dimension))};
  const double inner = table.number("inner", io::positive),
               outer = table.number("outer", io::positive);
  if (!(outer > inner)) table.fail("outer", "must be above `inner`.");
  const double from = table.number("from", io::any, 0.0),
               to = table.number("to", io::any, from + 360);
  if (!(to > from && to - from <= 360))
    table.fail("to", "must lie above `from`, by 360 degrees at most.");
  const double height = dimension == 3 ? table.number("height", io::positive) : 0;
  const Vec3 centre = table.has("centre") ? table.vector("centre", dimension) : Vec3::Zero();
  grid.closed = to - from == 360;
  if (grid.closed && grid.cells[1] < 3)
    table.fail("cells", "needs three cells around the circle at least.");
  if (degree * (to - from) / grid.cells[1] > 100 * degree)
    table.fail("cells", "has cells of more than 100 degrees. Use more around the axis.");
  grid.corner = [=, cells = grid.cells](const GridIndex& index) {
    return Vec3(inner + (outer - inner) * index[0] / cells[0],
                degree * (from + (to - from) * index[1] / cells[1]), height * index[2] / cells[2]);
  };
  grid.place = [=](const Vec3& p) {
    return Vec3(centre + Vec3(p[0] * std::cos(p[1]), p[0] * std::sin(p[1]), p[2]));
  };
  grid.sides = [](int side, const GridIndex&) -> std::vector<std::string> {
    static constexpr const char* names[] = {"inside", "outside", "start", "end", "z0", "z1"};
    return {names[side]};
  };
  return grid;
}

/// Half the side of the square in the middle of a disc, over its radius.
constexpr double core = 0.45;

/// Coordinates: those of a square of n × n cells with m rows on each side, whose corners are left out; the rows beside a left-out corner are
/// joined, and become a ring between the square and the circle.
Grid read_disc(const io::Table& table, int dimension) {
  const double radius = table.number("radius", io::positive), height = dimension == 3 ? table.number("height", io::positive) : 0;
  const auto counts = dimension == 3 ? table.numbers("cells") : std::vector<double>{table.number("cells"), 1};
  if (counts.size() != 2) table.fail("cells", "needs two whole numbers: around a quarter, and along the axis.");
  for (const double count : counts)
    if (count != std::floor(count) || count < 1 || count > 1e6)
      table.fail("cells", fmt::format("has {:.6g}; a number of cells is a whole number of at least 1.", count));
  const Vec3 centre = table.has("centre") ? table.vector("centre", dimension) : Vec3::Zero();
  const int n = static_cast<int>(counts[0]), m = (n + 1) / 2, end = m + n;
  Grid grid{.dimension = dimension, .cells = {n + 2 * m, n + 2 * m, static_cast<int>(counts[1])}};
  const auto beside = [=](int i) { return i < m || i >= end; };
  grid.keep = [=](const GridIndex& cell) { return !beside(cell[0]) || !beside(cell[1]); };
  grid.joined = [=](const GridIndex& index) -> GridIndex {
    const auto [i, j, k] = index;
    const int off = i < m ? m - i : i > end ? i - end : 0;  // from the square, along x
    if (off == 0 || (j != m && j != end)) return index;
    return {i < m ? m : end, j == m ? m - off : end + off, k};
  };
  grid.corner = [=](const GridIndex& index) { return Vec3(index[0], index[1], index[2]); };
  grid.place = [=, layers = counts[1]](const Vec3& p) {
    const Vec3 inner(2 * core * radius * ((p[0] - m) / n - 0.5), 2 * core * radius * ((p[1] - m) / n - 0.5), 0);
    const double height_here = height * p[2] / layers;
    for (const int d : {0, 1}) {
      const double off = p[d] < m ? m - p[d] : p[d] > end ? p[d] - end : 0;
      if (off == 0) continue;
      const double side = p[d] < m ? -1 : 1, across = inner[1 - d] / (core * radius), share = off / m, angle = 45 * degree * across;
      Vec3 from, to;  // on the square, on the circle
      from[d] = side * core * radius;
      from[1 - d] = across * core * radius;
      to[d] = side * radius * std::cos(angle);
      to[1 - d] = radius * std::sin(angle);
      from[2] = to[2] = height_here;
      return Vec3(centre + (1 - share) * from + share * to);
    }
    return Vec3(centre + Vec3(inner[0], inner[1], height_here));
  };
  grid.sides = [=, cells = grid.cells](int side, const GridIndex& cell) -> std::vector<std::string> {
    if (side >= 4) return {side == 4 ? "z0" : "z1"};
    const auto d = static_cast<std::size_t>(side / 2);
    if (cell[d] == (side % 2 ? cells[d] - 1 : 0)) return {"outside"};
    return {};
  };
  return grid;
}

Grid read_shape(const io::Table& table, const std::string& shape, int dimension) {
  if (shape == "bar") return read_bar(table, dimension);
  if (shape == "plate") return read_plate(table, dimension);
  if (shape == "box") return read_box(table, dimension);
  if (shape == "l_bracket") return read_bracket(table, dimension);
  if (shape == "disc" && dimension == 3) table.fail("is a shape in 2D; in 3D use a rod.");
  if (shape == "rod" && dimension == 2) table.fail("is a shape in 3D; in 2D use a disc.");
  if (shape == "disc" || shape == "rod") return read_disc(table, dimension);
  if (shape == "annulus" && dimension == 3) table.fail("is a shape in 2D; in 3D use a cylinder.");
  if (shape == "cylinder" && dimension == 2) table.fail("is a shape in 3D; in 2D use an annulus.");
  return read_annulus(table, dimension);
}

}  // namespace

MeshChoice read_mesh_choice(const io::Table& structure, int dimension) {
  if (!structure.is_table("mesh")) {
    const auto path = structure.path("mesh");
    return {read_physical_groups(path),
            [path, dimension] { return MeshSource::from_file(path, dimension); }};
  }
  const auto table = structure.table("mesh");
  std::string found;
  const std::vector<std::string> shapes{"bar", "plate", "box", "l_bracket", "annulus", "cylinder", "disc", "rod"};
  for (const auto& shape : shapes) {
    if (!table.has(shape)) continue;
    if (!found.empty())
      table.fail(shape, fmt::format("and {} are both given. A mesh is one shape.", found));
    found = shape;
  }
  if (found.empty()) {
    const auto keys = table.keys();
    const auto nearest = keys.empty() ? std::nullopt : io::nearest_word(keys.front(), shapes);
    structure.fail("mesh", fmt::format("names no shape: give one of {}.{}", fmt::join(shapes, ", "),
                                       nearest ? fmt::format(" Did you mean {}?", *nearest) : ""));
  }
  Grid grid = read_shape(table.table(found), found, dimension);
  grid.name = structure.name() + ".mesh";
  auto groups = build(grid).groups;
  return {std::move(groups), [grid] { return build(grid); }};
}

}  // namespace acopla::fem
