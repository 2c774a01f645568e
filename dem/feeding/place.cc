#include "dem/feeding/place.h"

#include <algorithm>
#include <cmath>

namespace acopla::dem {
namespace {

// A layer's rows and the shift of every second row and layer, in units of the spacing.
struct Pattern {
  double row = 1;            // distance of rows
  double shift_of_rows = 0;  // of every second row, along it
  double layer = 1;          // distance of layers
  double shift_of_layers[2] = {0, 0};
};

Pattern pattern_of(LatticeKind kind) {
  switch (kind) {
    case LatticeKind::hexagonal:
      return {1, 0, std::sqrt(3) / 2, {0.5, 0}};
    case LatticeKind::fcc:
      return {1, 0, std::sqrt(0.5), {0.5, 0.5}};  // square layers
    case LatticeKind::hcp:
      return {std::sqrt(3) / 2, 0.5, std::sqrt(2.0 / 3.0), {0.5, std::sqrt(3) / 6}};
    default:
      return {};
  }
}

}  // namespace

bool place_at_random(const Region& region, double radius, const Occupancy& occupancy, const Vacancy& vacant, Random& random, int tries,
                     Vec3& at) {
  for (int k = 0; k < tries; ++k) {
    at = region.random_point(random, radius);
    if (occupancy.is_free(at, radius) && (!vacant || vacant(at, radius))) return true;
  }
  return false;
}

std::vector<Vec3> lattice_sites(const Region& region, const Lattice& lattice, double radius, const Vec3& gravity, const Vacancy& vacant,
                                std::size_t at_most) {
  const int dimension = region.dimension();
  const double spacing = lattice.spacing > 0 ? lattice.spacing : 2 * radius;
  const auto pattern = pattern_of(lattice.kind);
  int up = dimension - 1;
  const double pull = gravity.head(dimension).cwiseAbs().maxCoeff(&up);
  if (!(pull > 0)) up = dimension - 1;
  const int along = up == 0 ? 1 : 0, across = 3 - up - along;  // of a row; of the rows in a layer
  const bool from_high = gravity[up] > 0;
  const auto bounds = region.bounds();
  const Vec3 extent = bounds.high - bounds.low, centre = region.centre();
  // Enough rows either way of the first; what is not inside drops out.
  const auto steps = [&](int axis, double pitch) { return static_cast<std::int64_t>(std::ceil(extent[axis] / (pitch * spacing))) + 1; };
  const auto first = [&](int axis) { return region.is_box() ? bounds.low[axis] + radius : centre[axis]; };
  const bool flat = dimension == 2;
  std::vector<Vec3> sites;
  for (std::int64_t layer = 0; layer <= steps(up, pattern.layer); ++layer) {
    const double height = radius + static_cast<double>(layer) * pattern.layer * spacing;
    const std::int64_t rows = flat ? 0 : steps(across, pattern.row), columns = steps(along, 1);
    for (std::int64_t row = -rows; row <= rows; ++row)
      for (std::int64_t column = -columns; column <= columns; ++column) {
        const bool odd_layer = layer % 2, odd_row = row % 2 != 0;
        Vec3 site = Vec3::Zero();
        site[up] = from_high ? bounds.high[up] - height : bounds.low[up] + height;
        site[along] =
            first(along) +
            (static_cast<double>(column) + (odd_row ? pattern.shift_of_rows : 0) + (odd_layer ? pattern.shift_of_layers[0] : 0)) * spacing;
        if (!flat)
          site[across] = first(across) + (static_cast<double>(row) * pattern.row + (odd_layer ? pattern.shift_of_layers[1] : 0)) * spacing;
        // A lattice that fits exactly must not lose its last row to round-off.
        if (!region.contains(site, radius * (1 - 1e-9)) || (vacant && !vacant(site, radius))) continue;
        sites.push_back(site);
        if (sites.size() == at_most) return sites;
      }
  }
  return sites;
}

Vec3 jittered(const Vec3& site, double radius, const Region& region, const Lattice& lattice, Random& random) {
  double room = lattice.spacing / 2 - radius;
  for (const auto& face : region.faces(site)) room = std::min(room, face.distance - radius);
  const Vec3 offset = Region::ball(Vec3::Zero(), 1, region.dimension()).random_point(random);
  return site + std::max(0.0, lattice.jitter * room) * offset;
}

}  // namespace acopla::dem
