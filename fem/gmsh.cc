#include "fem/gmsh.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <iterator>
#include <numeric>
#include <unordered_map>

#include "io/error.h"

namespace acopla::fem {
namespace {

using geometry::Vec3;

/// Words of a file, with the line they stand in.
class Scanner {
 public:
  explicit Scanner(const std::string& path) : path_(path) {
    std::ifstream file(path, std::ios::binary);
    if (!file) throw io::UserError(path + ": cannot be read.");
    text_.assign(std::istreambuf_iterator<char>(file), {});
  }

  [[noreturn]] void fail(const std::string& sentence) const {
    throw io::UserError(fmt::format("{}:{}: {}", path_, line_, sentence));
  }
  [[noreturn]] void fail_whole(const std::string& sentence) const {
    throw io::UserError(fmt::format("{}: {}", path_, sentence));
  }

  bool at_end() {
    skip_blanks();
    return at_ == text_.size();
  }
  std::string_view word() {
    if (at_end()) fail("the file ends in the middle of a section. Was it copied whole?");
    const auto from = at_;
    while (at_ < text_.size() && !is_blank(text_[at_])) ++at_;
    return std::string_view(text_).substr(from, at_ - from);
  }
  double number() {
    const auto text = word();
    double value = 0;
    const auto end = std::from_chars(text.data(), text.data() + text.size(), value);
    if (end.ec != std::errc() || end.ptr != text.data() + text.size() || !std::isfinite(value))
      fail(fmt::format("\"{}\" is not a number.", text));
    return value;
  }
  std::int64_t integer() {
    const auto text = word();
    std::int64_t value = 0;
    const auto end = std::from_chars(text.data(), text.data() + text.size(), value);
    if (end.ec != std::errc() || end.ptr != text.data() + text.size())
      fail(fmt::format("\"{}\" is not a whole number.", text));
    return value;
  }
  /// A number of things to come: each takes two bytes of the file at least.
  std::size_t count() {
    const auto value = integer();
    if (value < 0 || value > static_cast<std::int64_t>(text_.size()))
      fail(fmt::format("{} is not a possible count.", value));
    return static_cast<std::size_t>(value);
  }
  void expect(std::string_view wanted) {
    const auto found = word();
    if (found != wanted) fail(fmt::format("\"{}\" stands where {} is due.", found, wanted));
  }
  void skip_numbers(std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) number();
  }
  void skip_to(const std::string& marker) {
    while (word() != marker) {
    }
  }

 private:
  static bool is_blank(char c) { return c == ' ' || c == '\n' || c == '\r' || c == '\t'; }
  void skip_blanks() {
    for (; at_ < text_.size() && is_blank(text_[at_]); ++at_) line_ += text_[at_] == '\n';
  }

  std::string path_, text_;
  std::size_t at_ = 0;
  int line_ = 1;
};

/// An element type of gmsh that is read or passed over.
struct ElementType {
  int dimension = 0;
  bool simplex = false;
  std::size_t corners = 0;
  /// Of second order: the corners that each further node is in the middle of, in gmsh's order; a cell's own node has none.
  std::vector<std::vector<std::size_t>> middles = {};
  std::size_t nodes() const { return corners + middles.size(); }
};

const ElementType& element_type(const Scanner& scanner, std::int64_t type) {
  static const std::unordered_map<std::int64_t, ElementType> types{
      {15, {0, false, 1}},  // point
      {1, {1, false, 2}},   // line
      {2, {2, true, 3}},    // triangle
      {3, {2, false, 4}},   // quadrangle
      {4, {3, true, 4}},    // tetrahedron
      {5, {3, false, 8}},   // hexahedron
      {8, {1, false, 2, {{}}}},
      {9, {2, true, 3, {{0, 1}, {1, 2}, {2, 0}}}},
      {10, {2, false, 4, {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {}}}},
      {11, {3, true, 4, {{0, 1}, {1, 2}, {2, 0}, {3, 0}, {2, 3}, {1, 3}}}},
      {12, {3, false, 8, {{0, 1}, {0, 3}, {0, 4}, {1, 2}, {1, 5}, {2, 3}, {2, 6}, {3, 7}, {4, 5}, {4, 7}, {5, 6}, {6, 7},
                          {0, 1, 2, 3}, {0, 1, 5, 4}, {0, 3, 7, 4}, {1, 2, 6, 5}, {2, 3, 7, 6}, {4, 5, 6, 7}, {}}}}};
  const auto found = types.find(type);
  if (found != types.end()) return found->second;
  if (type == 6 || type == 7 || type == 13 || type == 14 || type == 18 || type == 19)
    scanner.fail("prisms and pyramids cannot be used. Mesh with hexahedra or with tetrahedra.");
  if (type == 16 || type == 17)
    scanner.fail(fmt::format("{} have no nodes in the middle of {}, where the cells of second order here do. Save complete ones "
                             "(Mesh.SecondOrderIncomplete = 0).",
                             type == 16 ? "quadrilaterals of 8 nodes" : "hexahedra of 20 nodes", type == 16 ? "the cell" : "faces and cell"));
  scanner.fail(fmt::format("elements of gmsh's type {} cannot be used. Save elements of first or second order (Mesh.ElementOrder = 1 or 2); "
                           "`degree` in the case sets the order of the displacements.",
                           type));
}

class Reader {
 public:
  Reader(const std::string& path, int dimension) : in_(path) { mesh_.dimension = dimension; }

  GmshMesh read() {
    while (!in_.at_end()) {
      const std::string section(in_.word());
      if (version_ == 0 && section != "$MeshFormat")
        in_.fail_whole("is not a gmsh mesh: it does not begin with $MeshFormat.");
      if (section.size() < 2 || section[0] != '$')
        in_.fail(fmt::format("\"{}\" stands where a section should begin.", section));
      if (section == "$MeshFormat") {
        read_format();
      } else if (section == "$Entities" && version_ >= 4) {
        read_entities();
      } else if (section == "$Nodes") {
        version_ >= 4 ? read_nodes_4() : read_nodes_2();
      } else if (section == "$Elements") {
        version_ >= 4 ? read_elements_4() : read_elements_2();
      } else {
        in_.skip_to("$End" + section.substr(1));
        continue;
      }
      in_.expect("$End" + section.substr(1));
    }
    finish();
    return std::move(mesh_);
  }

 private:
  void read_format() {
    version_ = in_.number();
    if (!(version_ >= 2 && version_ < 3) && version_ != 4.1)
      in_.fail("version 2 or 4.1 of gmsh's format is needed. Save it with -format msh41.");
    if (in_.integer() != 0) in_.fail("a binary mesh. Save it as ASCII (Mesh.Binary = 0).");
    in_.integer();
  }

  void read_entities() {
    std::size_t counts[4];
    for (auto& count : counts) count = in_.count();
    for (int dimension = 0; dimension < 4; ++dimension)
      for (std::size_t i = 0; i < counts[dimension]; ++i) {
        const auto tag = in_.integer();
        in_.skip_numbers(dimension == 0 ? 3 : 6);
        for (auto groups = in_.count(); groups > 0; --groups) {
          const auto group = static_cast<int>(std::abs(in_.integer()));
          groups_of_[static_cast<std::size_t>(dimension)][tag].push_back(group);
        }
        if (dimension > 0) in_.skip_numbers(in_.count());
      }
  }

  void add_node(std::int64_t tag, const Vec3& point) {
    if (!index_of_.emplace(tag, static_cast<std::uint32_t>(mesh_.points.size())).second)
      in_.fail(fmt::format("node {} is there twice.", tag));
    mesh_.points.push_back(point);
  }
  Vec3 read_point() {
    Vec3 point;
    for (int d = 0; d < 3; ++d) {
      point[d] = in_.number();
      if (std::abs(point[d]) > 1e12) in_.fail(fmt::format("{:g} m is no place.", point[d]));
    }
    return point;
  }
  void read_nodes_2() {
    for (auto left = in_.count(); left > 0; --left) {
      const auto tag = in_.integer();
      add_node(tag, read_point());
    }
  }
  void read_nodes_4() {
    const auto blocks = in_.count();
    in_.skip_numbers(3);
    for (std::size_t b = 0; b < blocks; ++b) {
      const auto dimension = in_.integer();
      in_.integer();
      const bool parametric = in_.integer() != 0;
      std::vector<std::int64_t> tags(in_.count());
      for (auto& tag : tags) tag = in_.integer();
      for (const auto tag : tags) {
        add_node(tag, read_point());
        if (parametric)
          in_.skip_numbers(static_cast<std::size_t>(std::clamp<std::int64_t>(dimension, 0, 3)));
      }
    }
  }

  void read_elements_2() {
    for (auto left = in_.count(); left > 0; --left) {
      in_.integer();
      const auto type = in_.integer();
      const auto tags = in_.count();
      int group = 0;
      for (std::size_t t = 0; t < tags; ++t) {
        const auto tag = in_.integer();
        if (t == 0) group = static_cast<int>(std::abs(tag));
      }
      read_element(type, {group});
    }
  }
  void read_elements_4() {
    const auto blocks = in_.count();
    in_.skip_numbers(3);
    for (std::size_t b = 0; b < blocks; ++b) {
      const auto dimension = in_.integer(), entity = in_.integer(), type = in_.integer();
      if (dimension < 0 || dimension > 3) in_.fail(fmt::format("{} is no dimension.", dimension));
      const auto& groups = groups_of_[static_cast<std::size_t>(dimension)][entity];
      for (auto left = in_.count(); left > 0; --left) {
        in_.integer();
        read_element(type, groups);
      }
    }
  }

  void read_element(std::int64_t type, const std::vector<int>& groups) {
    const auto& kind = element_type(in_, type);
    std::array<std::uint32_t, 27> all{};
    for (std::size_t i = 0; i < kind.nodes(); ++i) {
      const auto tag = in_.integer();
      const auto found = index_of_.find(tag);
      if (found == index_of_.end()) in_.fail(fmt::format("there is no node {}.", tag));
      all[i] = found->second;
    }
    std::array<std::uint32_t, 8> nodes{};
    std::copy_n(all.begin(), kind.corners, nodes.begin());
    if (kind.dimension > mesh_.dimension)
      in_.fail(
          "has solid cells, but the case says dimension = 2. A structure in 2D is meshed in the "
          "plane z = 0.");
    if (kind.dimension == mesh_.dimension) {
      add_cell(kind.simplex, nodes, groups);
      add_middles(kind, all);
      return;
    }
    if (kind.dimension == 0) {
      for (const int group : groups) mesh_.places[group].push_back(nodes[0]);
      return;
    }
    FaceKey key;
    key.fill(no_corner);
    std::copy_n(nodes.begin(), kind.corners, key.begin());
    std::sort(key.begin(), key.end());
    auto& parts = kind.dimension + 1 == mesh_.dimension ? mesh_.boundaries : mesh_.curves;
    for (const int group : groups) parts[group].push_back(key);
  }

  void add_middles(const ElementType& kind, const std::array<std::uint32_t, 27>& nodes) {
    for (std::size_t m = 0; m < kind.middles.size(); ++m) {
      const auto& point = mesh_.points[nodes[kind.corners + m]];
      FaceKey key;
      key.fill(no_corner);
      for (std::size_t c = 0; c < kind.middles[m].size(); ++c) key[c] = nodes[kind.middles[m][c]];
      std::sort(key.begin(), key.end());
      if (kind.middles[m].empty())
        centre_of_.emplace(mesh_.cells.size() - 1, point);
      else
        mesh_.middles.emplace(key, point);
    }
  }

  void add_cell(bool simplex, std::array<std::uint32_t, 8> nodes, const std::vector<int>& groups) {
    if (!mesh_.cells.empty() && simplex != mesh_.simplex)
      in_.fail(fmt::format("mixes {}. Use one of them alone.", mesh_.dimension == 2
                                                                   ? "quadrilaterals and triangles"
                                                                   : "hexahedra and tetrahedra"));
    mesh_.simplex = simplex;
    for (const int group : groups)
      mesh_.solids[group].push_back(static_cast<std::uint32_t>(mesh_.cells.size()));
    const auto p = [&](std::size_t i) -> const Vec3& { return mesh_.points[nodes[i]]; };
    // Elements may be numbered left-handed; turn those.
    if (mesh_.dimension == 2) {
      const auto last = mesh_.corners() - 1;  // diagonals of a quadrilateral, sides of a triangle
      if ((p(last - 1) - p(0)).cross(p(last) - p(simplex ? 0 : 1))[2] < 0)
        std::reverse(nodes.begin(), nodes.begin() + last + 1);
    } else if (simplex) {
      if ((p(1) - p(0)).cross(p(2) - p(0)).dot(p(3) - p(0)) < 0) std::swap(nodes[0], nodes[1]);
    } else {
      const Vec3 below = p(0) + p(1) + p(2) + p(3), above = p(4) + p(5) + p(6) + p(7);
      if ((p(2) - p(0)).cross(p(3) - p(1)).dot(above - below) < 0)
        std::swap_ranges(nodes.begin(), nodes.begin() + 4, nodes.begin() + 4);
    }
    mesh_.cells.push_back(nodes);
  }

  void finish() {
    if (mesh_.cells.empty())
      in_.fail_whole(
          fmt::format("has no cells. Put the solid in a Physical {}: gmsh saves named parts only.",
                      mesh_.dimension == 2 ? "Surface" : "Volume"));
    drop_repeated_cells();
    check_faces();
    drop_unused_points();
    check_plane();
    for (auto& [group, cells] : mesh_.solids) sort_once(cells);
    for (auto& [group, faces] : mesh_.boundaries) sort_once(faces);
    for (auto& [group, edges] : mesh_.curves) sort_once(edges);
    for (auto& [group, points] : mesh_.places) sort_once(points);
  }

  template <class T>
  static void sort_once(std::vector<T>& parts) {
    std::sort(parts.begin(), parts.end());
    parts.erase(std::unique(parts.begin(), parts.end()), parts.end());
  }

  void check_plane() {
    if (mesh_.dimension == 3) return;
    double extent = 0;
    for (const auto& p : mesh_.points) extent = std::max({extent, std::abs(p[0]), std::abs(p[1])});
    const auto flatten = [&](Vec3& p) {
      if (std::abs(p[2]) > 1e-9 * extent)
        in_.fail_whole(
            fmt::format("has a node at ({:.6g}, {:.6g}, {:.6g}), off the plane z = 0. A structure "
                        "in 2D lies in that "
                        "plane.",
                        p[0], p[1], p[2]));
      p[2] = 0;
    };
    for (auto& p : mesh_.points) flatten(p);
    for (auto& [key, p] : mesh_.middles) flatten(p);
    for (auto& p : mesh_.centres) flatten(p);
  }

  /// Version 2 writes a cell once for each physical volume that it is in.
  void drop_repeated_cells() {
    std::vector<std::pair<std::array<std::uint32_t, 8>, std::size_t>> sorted;
    for (std::size_t c = 0; c < mesh_.cells.size(); ++c) {
      auto nodes = mesh_.cells[c];
      std::sort(nodes.begin(), nodes.begin() + static_cast<std::ptrdiff_t>(mesh_.corners()));
      for (std::size_t i = 1; i < mesh_.corners(); ++i)
        if (nodes[i] == nodes[i - 1]) in_.fail_whole("has a cell with a corner twice.");
      sorted.emplace_back(nodes, c);
    }
    std::sort(sorted.begin(), sorted.end());
    std::vector<std::size_t> same_as(mesh_.cells.size());  // the first of the cells that are one
    for (std::size_t i = 0, first = 0; i < sorted.size(); ++i) {
      if (sorted[i].first != sorted[first].first) first = i;
      same_as[sorted[i].second] = sorted[first].second;
    }
    std::vector<std::uint32_t> number(mesh_.cells.size());
    std::uint32_t kept = 0;
    for (std::size_t c = 0; c < mesh_.cells.size(); ++c) {
      if (same_as[c] == c) {
        mesh_.cells[kept] = mesh_.cells[c];
        number[c] = kept++;
      } else {
        number[c] = number[same_as[c]];
      }
    }
    mesh_.cells.resize(kept);
    if (!centre_of_.empty()) {
      mesh_.centres.assign(kept, Vec3::Constant(std::nan("")));
      for (const auto& [cell, point] : centre_of_) mesh_.centres[number[cell]] = point;
      if (std::any_of(mesh_.centres.begin(), mesh_.centres.end(), [](const Vec3& p) { return std::isnan(p[0]); }))
        in_.fail_whole("mixes cells of first and second order. Save all of one order.");
    }
    for (auto& [group, cells] : mesh_.solids)
      for (auto& cell : cells) cell = number[cell];
  }

  void check_faces() const {
    static constexpr int of_hexahedron[6][4] = {{0, 1, 2, 3}, {4, 5, 6, 7}, {0, 1, 5, 4},
                                                {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}};
    static constexpr int of_tetrahedron[4][3] = {{0, 1, 2}, {0, 1, 3}, {0, 2, 3}, {1, 2, 3}};
    static constexpr int of_quadrilateral[4][2] = {{0, 1}, {1, 2}, {2, 3}, {3, 0}},
                         of_triangle[3][2] = {{0, 1}, {1, 2}, {2, 0}};
    std::vector<FaceKey> faces;
    const auto add = [&](const auto& cell, const auto& corners_of_face) {
      FaceKey key;
      key.fill(no_corner);
      std::transform(std::begin(corners_of_face), std::end(corners_of_face), key.begin(),
                     [&](int corner) { return cell[static_cast<std::size_t>(corner)]; });
      std::sort(key.begin(), key.end());
      faces.push_back(key);
    };
    for (const auto& cell : mesh_.cells) {
      if (mesh_.dimension == 2 && mesh_.simplex)
        for (const auto& edge : of_triangle) add(cell, edge);
      else if (mesh_.dimension == 2)
        for (const auto& edge : of_quadrilateral) add(cell, edge);
      else if (mesh_.simplex)
        for (const auto& face : of_tetrahedron) add(cell, face);
      else
        for (const auto& face : of_hexahedron) add(cell, face);
    }
    std::sort(faces.begin(), faces.end());
    for (std::size_t i = 2; i < faces.size(); ++i)
      if (faces[i] == faces[i - 2]) {
        const auto& p = mesh_.points[faces[i][0]];
        in_.fail_whole(fmt::format(
            "has {} that three cells share, at ({:.6g}, {:.6g}, {:.6g}). Mesh it again.",
            mesh_.dimension == 2 ? "an edge" : "a face", p[0], p[1], p[2]));
      }
  }

  void drop_unused_points() {
    constexpr auto unused = no_corner;
    std::vector<std::uint32_t> number(mesh_.points.size(), unused);
    for (const auto& cell : mesh_.cells)
      for (std::size_t i = 0; i < mesh_.corners(); ++i) number[cell[i]] = 0;
    std::uint32_t kept = 0;
    for (std::size_t n = 0; n < number.size(); ++n) {
      if (number[n] == unused) continue;
      mesh_.points[kept] = mesh_.points[n];
      number[n] = kept++;
    }
    mesh_.points.resize(kept);
    for (auto& cell : mesh_.cells)
      for (std::size_t i = 0; i < mesh_.corners(); ++i) cell[i] = number[cell[i]];
    for (auto* parts : {&mesh_.boundaries, &mesh_.curves})
      for (auto& [group, faces] : *parts)
        for (auto& face : faces) {
          for (auto& node : face)
            if (node != no_corner) node = number[node];
          std::sort(face.begin(), face.end());
        }
    for (auto& [group, points] : mesh_.places)
      for (auto& point : points) point = number[point];
    std::map<FaceKey, Vec3> middles;
    for (const auto& [key, point] : mesh_.middles) {
      FaceKey kept_key = key;
      for (auto& node : kept_key)
        if (node != no_corner) node = number[node];
      std::sort(kept_key.begin(), kept_key.end());
      middles.emplace(kept_key, point);
    }
    mesh_.middles = std::move(middles);
  }

  Scanner in_;
  double version_ = 0;
  GmshMesh mesh_;
  std::unordered_map<std::int64_t, std::uint32_t> index_of_;
  std::map<std::size_t, Vec3> centre_of_;  // by cell, before repeated ones are dropped
  std::array<std::unordered_map<std::int64_t, std::vector<int>>, 4>
      groups_of_;  // by dimension and entity
};

}  // namespace

GmshMesh read_gmsh(const std::string& path, int dimension) {
  return Reader(path, dimension).read();
}

}  // namespace acopla::fem
