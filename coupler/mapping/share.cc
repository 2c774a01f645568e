#include "coupler/mapping/share.h"

#include <limits>

#include "coupler/mapping/search.h"

namespace acopla::coupler {

std::vector<std::vector<char>> share_points(const geometry::SurfaceMesh& from, std::span<const geometry::SurfaceMesh* const> to, double max_distance) {
  const auto points = from.points.size();
  std::vector<double> least(points, std::numeric_limits<double>::infinity());
  std::vector<std::size_t> owner(points, 0);
  for (std::size_t k = 0; k < to.size(); ++k) {
    const PartnerSearch search(*to[k]);
    for (std::size_t point = 0; point < points; ++point) {
      // As near but for round-off: the first keeps it.
      const auto partner = search.nearest(from.points[point], std::min(max_distance, least[point] - search.tie_tolerance()));
      if (!partner) continue;
      least[point] = partner->projection.distance;
      owner[point] = k;
    }
  }
  std::vector<std::vector<char>> shares(to.size(), std::vector<char>(points, 0));
  for (std::size_t point = 0; point < points; ++point) shares[owner[point]][point] = 1;
  return shares;
}

}  // namespace acopla::coupler
