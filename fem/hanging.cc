#include "fem/hanging.h"

#include <algorithm>
#include <cmath>

namespace acopla::fem {
namespace {

/// Places are the same within this share of the mesh's diagonal: meshes are written with seven digits or more.
constexpr double same_place = 1e-7;

/// Corners of the boundary, ascending along x.
std::vector<Vec3> corners_of_boundary(const Mesh& mesh, const std::vector<BoundaryFace>& faces) {
  std::vector<char> is_corner(mesh.nodes(), 0);
  for (const auto& face : faces)
    for (const auto node : face.used().first(geometry::corners_of(face.kind))) is_corner[node] = 1;
  std::vector<Vec3> corners;
  for (std::size_t n = 0; n < mesh.nodes(); ++n)
    if (is_corner[n]) corners.push_back(mesh.points()[n]);
  return corners;
}

/// Places sorted by a key in which few of a plane face fall together: a sum with irrational weights.
class Places {
 public:
  Places(std::vector<Vec3> points, double tolerance) : tolerance_(tolerance) {
    for (const auto& p : points) sorted_.push_back({key(p), p});
    std::sort(sorted_.begin(), sorted_.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  }
  bool has(const Vec3& p) const {
    const double reach = 2 * tolerance_, at = key(p);
    auto i = std::lower_bound(sorted_.begin(), sorted_.end(), at - reach, [](const auto& a, double k) { return a.first < k; });
    for (; i != sorted_.end() && i->first <= at + reach; ++i)
      if ((i->second - p).norm() <= tolerance_) return true;
    return false;
  }

 private:
  static double key(const Vec3& p) { return Vec3(0.79, 0.2233 * std::sqrt(2.0), 0.1711 * std::sqrt(3.0)).dot(p); }  // a slope below 1
  double tolerance_;
  std::vector<std::pair<double, Vec3>> sorted_;
};

}  // namespace

std::optional<Vec3> hanging_node(const Mesh& mesh) {
  const auto faces = mesh.boundary();
  const Places places(corners_of_boundary(mesh, faces), same_place * mesh.extent());
  for (const auto& face : faces) {
    const auto corners = face.used().first(geometry::corners_of(face.kind));
    Vec3 middle = Vec3::Zero();
    for (std::size_t a = 0; a < corners.size(); ++a) {
      const Vec3 &from = mesh.points()[corners[a]], &to = mesh.points()[corners[(a + 1) % corners.size()]];
      middle += from / static_cast<double>(corners.size());
      const Vec3 half = 0.5 * (from + to);
      if (places.has(half)) return half;
    }
    if (places.has(middle)) return middle;
  }
  return std::nullopt;
}

}  // namespace acopla::fem
