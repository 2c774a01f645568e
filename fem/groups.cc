// The names of a gmsh file's physical groups: deal.II keeps only their numbers.
#include <algorithm>
#include <fstream>
#include <sstream>

#include "fem/mesh_source.h"
#include "io/case_table.h"

namespace acopla::fem {
namespace {

std::string trimmed(std::string line) {
  while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) line.pop_back();
  return line;
}

[[noreturn]] void fail(const std::string& path, const std::string& sentence) {
  throw io::UserError(path + ": " + sentence);
}

void check_format(const std::string& path, const std::string& line) {
  double version = 0;
  int binary = 1;
  std::istringstream(line) >> version >> binary;
  const bool known = (version >= 2 && version < 3) || version == 4.1;
  if (!known) fail(path, "is not a gmsh mesh of version 2 or 4.1. Save it with -format msh41.");
  if (binary != 0) fail(path, "is a binary gmsh mesh. Save it as ASCII (Mesh.Binary = 0).");
}

PhysicalGroup parse_group(const std::string& path, const std::string& line) {
  PhysicalGroup group;
  std::istringstream words(line);
  const auto open = line.find('"'), close = line.rfind('"');
  if (!(words >> group.dimension >> group.id) || open == std::string::npos || close <= open)
    fail(path, "has a line in $PhysicalNames that is not: dimension number \"name\".");
  group.name = line.substr(open + 1, close - open - 1);
  return group;
}

constexpr const char* kinds[] = {"points", "curves", "surfaces", "volumes"};
constexpr const char* kind_in_gmsh[] = {"Point", "Curve", "Surface", "Volume"};

std::string list_of_groups(const std::vector<PhysicalGroup>& groups, const std::string& name,
                           std::size_t dimension) {
  std::vector<std::string> names;
  std::string text;
  for (const auto& group : groups) {
    if (static_cast<std::size_t>(group.dimension) != dimension) continue;
    text += (text.empty() ? "" : ", ") + group.name;
    names.push_back(group.name);
  }
  const std::string kind = kinds[dimension];
  if (text.empty())
    return "The mesh names no " + kind.substr(0, kind.size() - 1) + " (gmsh: Physical " +
           kind_in_gmsh[dimension] + "(\"name\") = {…}).";
  const auto nearest = io::nearest_word(name, names);
  return "The mesh has the " + kind + " " + text + "." +
         (nearest ? " Did you mean \"" + *nearest + "\"?" : "");
}

}  // namespace

std::vector<PhysicalGroup> read_physical_groups(const std::string& path) {
  std::ifstream file(path);
  if (!file) fail(path, "cannot be read.");
  std::vector<PhysicalGroup> groups;
  std::string line;
  bool is_gmsh = false;
  while (std::getline(file, line)) {
    line = trimmed(line);
    if (line == "$MeshFormat" && std::getline(file, line)) {
      check_format(path, line);
      is_gmsh = true;
    } else if (line == "$PhysicalNames" && std::getline(file, line)) {
      while (std::getline(file, line) && trimmed(line) != "$EndPhysicalNames")
        groups.push_back(parse_group(path, trimmed(line)));
    } else if (line == "$Nodes" || !is_gmsh) {
      break;  // names stand before the nodes
    }
  }
  if (!is_gmsh) fail(path, "is not a gmsh mesh: it does not begin with $MeshFormat.");
  return groups;
}

const PhysicalGroup& find_group(const std::vector<PhysicalGroup>& groups, const std::string& name,
                                int dimension) {
  const auto wanted = static_cast<std::size_t>(dimension);
  const auto named = [&](const PhysicalGroup& group) { return group.name == name; };
  const auto found = std::find_if(groups.begin(), groups.end(), [&](const PhysicalGroup& group) {
    return named(group) && group.dimension == dimension;
  });
  if (found != groups.end()) return *found;
  const auto other = std::find_if(groups.begin(), groups.end(), named);
  if (other == groups.end())
    throw std::invalid_argument("is not in the mesh. " + list_of_groups(groups, name, wanted));
  const auto kind = static_cast<std::size_t>(std::clamp(other->dimension, 0, 3));
  const std::string singular(kinds[wanted], std::string(kinds[wanted]).size() - 1);
  throw std::invalid_argument(std::string("is made of ") + kinds[kind] + "; a " + singular +
                              " is needed here. " + list_of_groups(groups, name, wanted));
}

MeshSource MeshSource::from_file(const std::string& path, int dimension) {
  return {path, read_gmsh(path, dimension), read_physical_groups(path), {}, {}};
}

}  // namespace acopla::fem
