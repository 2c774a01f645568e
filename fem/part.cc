#include "fem/part.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace acopla::fem {
namespace {

constexpr double degree = 3.14159265358979323846 / 180;

/// What `get` gives for each group, one after the other, each part once.
template <class T, class Get>
std::vector<T> gather(const std::vector<std::string>& groups, const Get& get) {
  std::vector<T> result;
  for (const auto& group : groups) try {
      const auto more = get(group);
      result.insert(result.end(), more.begin(), more.end());
    } catch (const std::invalid_argument& error) {
      throw std::invalid_argument(fmt::format("names \"{}\", which {}", group, error.what()));
    }
  return result;
}

bool in_box(const Mesh& mesh, const BoundaryFace& face, const std::pair<Vec3, Vec3>& box) {
  const double slack = 1e-9 * mesh.extent();
  return std::all_of(face.used().begin(), face.used().end(), [&](std::uint32_t node) {
    const auto& p = mesh.points()[node];
    for (int d = 0; d < mesh.dimension(); ++d)
      if (p[d] < box.first[d] - slack || p[d] > box.second[d] + slack) return false;
    return true;
  });
}

bool in_arc(const Mesh& mesh, const BoundaryFace& face, const Part::Arc& arc, const Vec3& centre) {
  Vec3 middle = Vec3::Zero();
  const auto corners = geometry::corners_of(face.kind);
  for (std::size_t i = 0; i < corners; ++i)
    middle += mesh.points()[face.nodes[i]] / static_cast<double>(corners);
  const double angle = std::atan2(middle[1] - centre[1], middle[0] - centre[0]);
  constexpr double turn = 360 * degree, slack = 1e-9;  // a middle on the arc's end is in it
  const double beyond = std::fmod(std::fmod(angle - arc.from + slack, turn) + turn, turn);
  return beyond <= arc.to - arc.from + 2 * slack;
}

Vec3 middle_of(const Mesh& mesh) {
  Vec3 low = mesh.points().front(), high = low;
  for (const auto& p : mesh.points()) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  return 0.5 * (low + high);
}

}  // namespace

std::vector<BoundaryFace> Part::faces(const Mesh& mesh) const {
  auto result = groups.empty() ? mesh.boundary()
                               : gather<BoundaryFace>(groups, [&](const std::string& group) {
                                   return mesh.boundary(group);
                                 });
  if (box)
    std::erase_if(result, [&](const BoundaryFace& face) { return !in_box(mesh, face, *box); });
  if (arc) {
    const Vec3 centre = arc->centre.value_or(middle_of(mesh));
    std::erase_if(result,
                  [&](const BoundaryFace& face) { return !in_arc(mesh, face, *arc, centre); });
  }
  // A face of two groups counts once.
  std::vector<BoundaryFace> once;
  std::vector<std::pair<std::vector<std::uint32_t>, std::size_t>> sorted;
  for (std::size_t i = 0; i < result.size(); ++i) {
    std::vector<std::uint32_t> key(result[i].used().begin(), result[i].used().end());
    std::sort(key.begin(), key.end());
    sorted.emplace_back(std::move(key), i);
  }
  std::sort(sorted.begin(), sorted.end());
  std::vector<char> repeated(result.size(), 0);
  for (std::size_t i = 1; i < sorted.size(); ++i)
    if (sorted[i].first == sorted[i - 1].first) repeated[sorted[i].second] = 1;
  for (std::size_t i = 0; i < result.size(); ++i)
    if (!repeated[i]) once.push_back(result[i]);
  if (once.empty()) throw std::invalid_argument("holds no face of the boundary.");
  return once;
}

std::vector<BoundaryFace> Part::curves(const Mesh& mesh) const {
  return gather<BoundaryFace>(groups, [&](const std::string& group) { return mesh.curve(group); });
}

std::vector<std::uint32_t> Part::places(const Mesh& mesh) const {
  return gather<std::uint32_t>(groups,
                               [&](const std::string& group) { return mesh.places(group); });
}

namespace {

std::string last_word(const std::string& dotted) { return dotted.substr(dotted.rfind('.') + 1); }

void check_groups(const io::Table& table, const std::vector<PhysicalGroup>& groups, int kind,
                  const std::vector<std::string>& names) {
  for (const auto& name : names) try {
      find_group(groups, name, kind);
    } catch (const std::invalid_argument& error) {
      if (table.has("on"))
        table.fail("on", fmt::format("names \"{}\", which {}", name, error.what()));
      table.fail(error.what());
    }
}

Part::Arc read_arc(const io::Table& table, int dimension) {
  Part::Arc arc;
  arc.from = degree * table.number("from");
  arc.to = degree * table.number("to");
  if (!(arc.to > arc.from && arc.to - arc.from <= 360 * degree))
    table.fail("to",
               "must lie above `from`, by 360 degrees at most; the arc runs counter-clockwise.");
  if (table.has("centre")) arc.centre = table.vector("centre", dimension);
  return arc;
}

}  // namespace

Part read_part(const io::Table& table, const std::vector<PhysicalGroup>& groups, int dimension,
               int kind) {
  Part part;
  if (!table.has("on")) {
    part.groups = {last_word(table.name())};
  } else if (table.is_text("on")) {
    part.groups = {table.text("on")};
  } else if (!table.is_table("on")) {
    part.groups = table.texts("on");
  } else {
    if (kind != dimension - 1)
      table.fail("on", "must name a group of the mesh: boxes and arcs choose faces.");
    const auto on = table.table("on");
    if (on.has("box")) {
      const auto corners = on.vectors("box", dimension);
      if (corners.size() != 2) on.fail("box", "needs two corners, [[x, y, …], [x, y, …]].");
      part.box = {corners[0].cwiseMin(corners[1]), corners[0].cwiseMax(corners[1])};
    } else if (on.has("arc")) {
      const auto arc = on.table("arc");
      part.arc = read_arc(arc, dimension);
      const bool outside =
          std::any_of(groups.begin(), groups.end(), [&](const PhysicalGroup& group) {
            return group.name == "outside" && group.dimension == kind;
          });
      if (arc.has("of"))
        part.groups = {arc.text("of")};
      else if (outside)
        part.groups = {"outside"};
    } else {
      table.fail("on",
                 "is a group's name, a list of them, { box = [[…], […]] } or { arc = { from = …, "
                 "to = … } }.");
    }
  }
  check_groups(table, groups, kind, part.groups);
  return part;
}

std::vector<std::uint32_t> nodes_of(const std::vector<BoundaryFace>& faces) {
  std::vector<std::uint32_t> nodes;
  for (const auto& face : faces) nodes.insert(nodes.end(), face.used().begin(), face.used().end());
  std::sort(nodes.begin(), nodes.end());
  nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
  return nodes;
}

}  // namespace acopla::fem
