#include "gmsh_writer.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <vector>

namespace acopla::fem::test {
namespace {

using Nodes = std::vector<int>;  // of one element, counted from 1
constexpr const char* sides[] = {"x0", "x1", "y0", "y1", "z0", "z1"};

class Writer {
 public:
  explicit Writer(const Block& block) : block_(block) {
    const auto [nx, ny, nz] = block.cells;
    for (auto& count : block_.cells) count *= block.order;
    for (int k = 0; k < nz; ++k)
      for (int j = 0; j < ny; ++j)
        for (int i = 0; i < nx; ++i) add_hexahedron(i, j, k);
  }

  std::string text() const {
    auto result =
        fmt::format("$MeshFormat\n{} 0 8\n$EndMeshFormat\n$PhysicalNames\n11\n", block_.version);
    for (int s = 0; s < 6; ++s) result += fmt::format("2 {} \"{}\"\n", s + 1, sides[s]);
    result +=
        "3 7 \"solid\"\n1 8 \"edge\"\n1 9 \"ridge\"\n0 10 \"corner\"\n3 11 "
        "\"other\"\n$EndPhysicalNames\n";
    return result + (block_.version < 4 ? body_2() : body_4());
  }

 private:
  int node(int i, int j, int k) const {
    return (k * (block_.cells[1] + 1) + j) * (block_.cells[0] + 1) + i + 1;
  }

  void add_hexahedron(int i, int j, int k) {
    std::array<int, 8> n;
    for (int c = 0; c < 8; ++c)
      n[static_cast<std::size_t>(c)] = node(block_.order * (i + (c & 1)), block_.order * (j + (c >> 1 & 1)), block_.order * (k + (c >> 2)));
    if (block_.tetrahedra) {  // Kuhn: the paths along the edges from corner 0 to corner 7
      for (const auto& path : {std::array{1, 3}, {3, 2}, {2, 6}, {6, 4}, {4, 5}, {5, 1}})
        add_cell({n[0], n[static_cast<std::size_t>(path[0])], n[static_cast<std::size_t>(path[1])],
                  n[7]},
                 {{0, 1, 2}, {0, 1, 3}, {0, 2, 3}, {1, 2, 3}});
      return;
    }
    add_cell({n[0], n[1], n[3], n[2], n[4], n[5], n[7], n[6]},
             {{0, 3, 2, 1}, {4, 5, 6, 7}, {0, 1, 5, 4}, {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}});
  }

  void add_cell(const Nodes& cell, const std::vector<Nodes>& faces) {
    cells_.push_back(with_middles(cell));
    for (const auto& face : faces) {
      Nodes nodes;
      for (const int corner : face) nodes.push_back(cell[static_cast<std::size_t>(corner)]);
      for (std::size_t s = 0; s < 6; ++s)
        if (std::all_of(nodes.begin(), nodes.end(), [&](int n) { return lies_on(n, s); }))
          faces_[s].push_back(with_middles(nodes));
    }
  }

  /// Adds the nodes of second order, in gmsh's order.
  Nodes with_middles(Nodes corners) const {
    if (block_.order == 1) return corners;
    static const std::map<std::pair<std::size_t, bool>, std::vector<Nodes>> middles{
        {{2, false}, {{0, 1}}},
        {{3, true}, {{0, 1}, {1, 2}, {2, 0}}},
        {{4, false}, {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {0, 1, 2, 3}}},
        {{4, true}, {{0, 1}, {1, 2}, {2, 0}, {3, 0}, {2, 3}, {1, 3}}},
        {{8, false}, {{0, 1}, {0, 3}, {0, 4}, {1, 2}, {1, 5}, {2, 3}, {2, 6}, {3, 7}, {4, 5}, {4, 7}, {5, 6}, {6, 7},
                      {0, 1, 2, 3}, {0, 1, 5, 4}, {0, 3, 7, 4}, {1, 2, 6, 5}, {2, 3, 7, 6}, {4, 5, 6, 7}, {0, 1, 2, 3, 4, 5, 6, 7}}}};
    const auto count = corners.size();
    Nodes result = corners;
    for (const auto& middle : middles.at({count, count > 2 && block_.tetrahedra})) {
      std::array<int, 3> sum{};
      for (const int corner : middle)
        for (std::size_t d = 0; d < 3; ++d) sum[d] += indices(corners[static_cast<std::size_t>(corner)])[d];
      const int size = static_cast<int>(middle.size());
      result.push_back(node(sum[0] / size, sum[1] / size, sum[2] / size));
    }
    return result;
  }

  std::array<int, 3> indices(int n) const {
    const int nx = block_.cells[0] + 1, ny = block_.cells[1] + 1;
    return {(n - 1) % nx, (n - 1) / nx % ny, (n - 1) / (nx * ny)};
  }
  bool lies_on(int n, std::size_t side) const {
    return indices(n)[side / 2] == (side % 2 ? block_.cells[side / 2] : 0);
  }

  int node_count() const { return node(block_.cells[0], block_.cells[1], block_.cells[2]); }
  std::string coordinates(int n) const {
    const auto index = indices(n);
    Vec3 p;
    for (std::size_t d = 0; d < 3; ++d)
      p[static_cast<int>(d)] = block_.size[static_cast<int>(d)] * index[d] / block_.cells[d];
    p = block_.move(p);
    return fmt::format("{:.17g} {:.17g} {:.17g}\n", p[0], p[1], p[2]);
  }
  /// Lines of the edge at the top of x and z.
  std::vector<Nodes> ridge() const {
    const auto [nx, ny, nz] = block_.cells;
    std::vector<Nodes> lines;
    for (int j = 0; j < ny; j += block_.order) lines.push_back(with_middles({node(nx, j, nz), node(nx, j + block_.order, nz)}));
    return lines;
  }
  /// Cells of "solid", or of "other".
  std::vector<Nodes> cells_of(bool other) const {
    std::vector<Nodes> result;
    const auto half = [&](const Nodes& cell) {
      int sum = 0;
      for (const int n : cell) sum += indices(n)[0];
      return 2 * sum > block_.cells[0] * static_cast<int>(cell.size());
    };
    for (const auto& cell : cells_)
      if ((block_.two_solids && half(cell)) == other) result.push_back(cell);
    return result;
  }
  int of_order(int type) const { return block_.order == 1 ? type : type + 7; }  // 8 to 12
  int cell_type() const { return of_order(block_.tetrahedra ? 4 : 5); }
  int face_type() const { return of_order(block_.tetrahedra ? 2 : 3); }
  std::size_t element_count() const {
    std::size_t count = cells_.size() + ridge().size() + 1;
    for (const auto& faces : faces_) count += faces.size();
    return count;
  }

  std::string body_2() const {
    auto text = fmt::format("$Nodes\n{}\n", node_count());
    for (int n = 1; n <= node_count(); ++n) text += fmt::format("{} {}", n, coordinates(n));
    text += fmt::format("$EndNodes\n$Elements\n{}\n", element_count());
    int next = 1;
    const auto add = [&](int type, int group, const Nodes& nodes) {
      text += fmt::format("{} {} 2 {} {} {}\n", next++, type, group, group, fmt::join(nodes, " "));
    };
    for (int s = 0; s < 6; ++s)
      for (const auto& face : faces_[static_cast<std::size_t>(s)]) add(face_type(), s + 1, face);
    add(15, 10, {node_count()});
    for (const auto& line : ridge()) add(of_order(1), 9, line);
    for (const auto& cell : cells_of(false)) add(cell_type(), 7, cell);
    for (const auto& cell : cells_of(true)) add(cell_type(), 11, cell);
    return text + "$EndElements\n";
  }

  std::string body_4() const {
    std::string text = "$Entities\n1 1 6 2\n1 0 0 0 1 10\n1 0 0 0 1 1 1 1 9 0\n";
    for (int s = 1; s <= 6; ++s) text += fmt::format("{} 0 0 0 1 1 1 1 {} 0\n", s, s);
    text += "1 0 0 0 1 1 1 1 7 0\n2 0 0 0 1 1 1 1 11 0\n$EndEntities\n";
    text += fmt::format("$Nodes\n1 {0} 1 {0}\n3 1 0 {0}\n", node_count());
    for (int n = 1; n <= node_count(); ++n) text += fmt::format("{}\n", n);
    for (int n = 1; n <= node_count(); ++n) text += coordinates(n);
    text += fmt::format("$EndNodes\n$Elements\n10 {0} 1 {0}\n", element_count());
    int next = 1;
    const auto add = [&](int dimension, int tag, int type, const std::vector<Nodes>& elements) {
      text += fmt::format("{} {} {} {}\n", dimension, tag, type, elements.size());
      for (const auto& nodes : elements)
        text += fmt::format("{} {}\n", next++, fmt::join(nodes, " "));
    };
    for (int s = 0; s < 6; ++s) add(2, s + 1, face_type(), faces_[static_cast<std::size_t>(s)]);
    add(0, 1, 15, {{node_count()}});
    add(1, 1, of_order(1), ridge());
    add(3, 1, cell_type(), cells_of(false));
    add(3, 2, cell_type(), cells_of(true));
    return text + "$EndElements\n";
  }

  Block block_;  // cells counted in steps of nodes
  std::vector<Nodes> cells_;
  std::array<std::vector<Nodes>, 6> faces_;
};

}  // namespace

std::string write_block(const std::string& name, const Block& block) {
  return write_file(name + ".msh", Writer(block).text());
}

Vec3 distort(const Vec3& p) {
  constexpr double pi = 3.141592653589793;
  const auto bump = [](double x) { return std::sin(pi * x); };  // 0 on the sides of the unit cube
  return p + 0.04 * Vec3(bump(p[0]) * std::cos(3 * p[1] + p[2]),
                         bump(p[1]) * std::cos(2 * p[2] - p[0]),
                         bump(p[2]) * std::cos(4 * p[0] + p[1]));
}

std::string write_file(const std::string& name, const std::string& text) {
  const auto* test = testing::UnitTest::GetInstance()->current_test_info();
  auto folder = std::filesystem::path(testing::TempDir()) / "acopla_fem" / test->test_suite_name() /
                test->name();
  std::filesystem::create_directories(folder);
  const auto path = (folder / name).string();
  std::ofstream(path) << text;
  return path;
}

}  // namespace acopla::fem::test
