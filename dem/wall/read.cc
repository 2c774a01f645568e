#include "dem/wall/read.h"
#include <algorithm>
namespace acopla::dem {
Wall read_wall(const io::Table& table, const std::string& name, const std::vector<std::string>& names, int dimension) {
      Wall wall;
      wall.name = name;
  const auto chosen = table.choice("material", names);
  wall.material= static_cast<std::uint8_t>(std::find(names.begin(), names.end(), chosen) - names.begin());
      if (table.has("plane") == table.has("mesh")) table.fail("needs exactly one of plane and mesh.");
      if (table.has("plane")) {
        const auto plane = table.table("plane");
        wall.is_plane = true;
        wall.point = plane.vector("point", dimension);
        wall.normal = plane.vector("normal", dimension);
        wall.normal.normalize();
      } else {
        wall.mesh = io::read_stl(table.path("mesh"));
      }
      return wall;
}
}
