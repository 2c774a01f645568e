#include "coupler/mapping/mapping.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "coupler/mapping/overlap.h"
#include "coupler/mapping/search.h"
#include "geometry/couple.h"

namespace acopla::coupler {
namespace {

using geometry::CoupleCarrier;
using geometry::SurfaceMesh;

constexpr double round_off =
    1e-14;  // of the surface's extent: nearer than this a point lies on its face
constexpr double lost_fraction =
    1e-13;  // moment lost per force, of the extent: less than this nobody can see

Eigen::Matrix3d cross_matrix(const Vec3& a) {
  Eigen::Matrix3d matrix;
  matrix << 0, -a[2], a[1], a[2], 0, -a[0], -a[1], a[0], 0;
  return matrix;
}

std::vector<bool> carrying_points(const SurfaceMesh& surface) {
  std::vector<bool> carrying(surface.points.size(), surface.face_count() == 0);
  for (const auto node : surface.connectivity()) carrying[node] = true;
  return carrying;
}

bool plane(const SurfaceMesh& surface) {
  return std::all_of(surface.points.begin(), surface.points.end(),
                     [](const Vec3& x) { return x[2] == 0; });
}

void check_length(std::size_t given, std::size_t expected, const char* what) {
  if (given != expected)
    throw std::invalid_argument("mapping: " + std::to_string(given) + " vectors given for the " +
                                std::to_string(expected) + " " + what);
}

/// Faces around each node, one node after another.
class FacesAtNodes {
 public:
  explicit FacesAtNodes(const SurfaceMesh& surface) : starts_(surface.points.size() + 1, 0) {
    for (const auto node : surface.connectivity()) ++starts_[node + 1];
    for (std::size_t k = 1; k < starts_.size(); ++k) starts_[k] += starts_[k - 1];
    faces_.resize(starts_.back());
    auto next = starts_;
    for (std::uint32_t face = 0; face < surface.face_count(); ++face)
      for (const auto node : surface.nodes(face)) faces_[next[node]++] = face;
  }
  std::span<const std::uint32_t> operator[](std::uint32_t node) const {
    return {faces_.data() + starts_[node], faces_.data() + starts_[node + 1]};
  }

 private:
  std::vector<std::size_t> starts_;
  std::vector<std::uint32_t> faces_;
};

}  // namespace

/// The nodes nearest to a place, of a surface that need not have faces.
class NearestNodes {
 public:
  explicit NearestNodes(const SurfaceMesh& surface) : surface_(surface), grid_(boxes_of(surface)) {}

  /// The `count` nearest, nearest first, the lowest index of those as near; fewer where there are no more within `reach` [m].
  std::vector<std::uint32_t> find(const Vec3& x, std::size_t count, double reach) const {
    std::vector<std::uint32_t> found;
    const auto distance = [&](std::uint32_t node) { return (surface_.points[node] - x).norm(); };
    const double limit = std::min(reach, (grid_.bounds().high - x).cwiseAbs().cwiseMax((grid_.bounds().low - x).cwiseAbs()).norm());
    for (double half = std::min(grid_.size(), limit);; half = std::min(2 * half, limit)) {
      found.clear();
      grid_.for_each_near(x - Vec3::Constant(half), x + Vec3::Constant(half), [&](std::uint32_t node) {
        if (distance(node) <= half) found.push_back(node);
      });
      std::sort(found.begin(), found.end());
      found.erase(std::unique(found.begin(), found.end()), found.end());
      if (found.size() >= count || half >= limit) break;
    }
    std::stable_sort(found.begin(), found.end(), [&](auto a, auto b) { return distance(a) < distance(b); });
    if (found.size() > count) found.resize(count);
    return found;
  }

 private:
  static std::vector<geometry::Box> boxes_of(const SurfaceMesh& surface) {
    std::vector<geometry::Box> boxes;
    for (const auto& point : surface.points) boxes.push_back({point, point});
    return boxes;
  }
  const SurfaceMesh& surface_;
  geometry::BucketGrid grid_;
};

/// Fills a mapping point by point.
class Mapping::Builder {
 public:
  Builder(Mapping& mapping, const SurfaceMesh& from, const SurfaceMesh& to)
      : mapping_(mapping), from_(from), to_(to), extent_(to.extent()), plane_(plane(from) && plane(to)) {
    if (plane_) forces_.z() = 0;
  }

  void by_projection(const std::vector<bool>& taking, double max_distance) {
    const PartnerSearch search(to_);
    reserve(4 * from_.points.size());
    for_each_point(taking, [&](std::uint32_t point, const Vec3& x) { return project(point, x, search, max_distance); });
  }

  void by_overlap(const std::vector<bool>& taking, double max_distance) {
    const PartnerSearch search(to_);
    const auto overlap = overlap_of(from_, to_, search, max_distance);
    reserve(overlap.nodes.size());
    for_each_point(taking, [&](std::uint32_t point, const Vec3& x) {
      const auto start = overlap.starts[point], size = overlap.starts[point + 1] - start;
      if (size == 0) {
        const bool found = project(point, x, search, max_distance);
        if (found) ++mapping_.uncovered_;
        return found;
      }
      const std::span<const std::uint32_t> nodes{overlap.nodes.data() + start, size};
      add(point, x, nodes, {overlap.weights.data() + start, size}, nodes);
      // Faces over those around a point may all be farther from itself than the limit.
      const auto partner = search.nearest(x, std::numeric_limits<double>::infinity());
      note_distance(point, partner->projection.distance);
      return true;
    });
  }

  void by_nearest_node(const std::vector<bool>& taking, double max_distance) {
    const NearestNodes search(to_);
    // As many as carry any couple: in the plane two nodes, in space three that are not on a line, and one to spare.
    const std::size_t enough = plane_ ? 2 : 4;
    constexpr double one = 1;
    for_each_point(taking, [&](std::uint32_t point, const Vec3& x) {
      const auto nearest = search.find(x, 1, max_distance);
      if (nearest.empty()) return false;
      // More, where some of them coincide or stand on a line.
      auto around = search.find(x, enough, std::numeric_limits<double>::infinity());
      const auto offset = Vec3(x - to_.points[nearest.front()]);
      for (auto count = 2 * enough; count <= 16 * enough && loses(carrier_of(around), unit_couples(offset)); count *= 2)
        around = search.find(x, count, std::numeric_limits<double>::infinity());
      add(point, x, nearest, {&one, 1}, around);
      note_distance(point, (x - to_.points[nearest.front()]).norm());
      return true;
    });
  }

 private:
  /// For so many shares of nodes, each of which may carry a couple too.
  void reserve(std::size_t count) {
    mapping_.nodes_.reserve(count);
    mapping_.weights_.reserve(count);
    mapping_.couples_.reserve(from_.points.size());
    mapping_.couple_starts_.reserve(from_.points.size() + 1);
    mapping_.couple_nodes_.reserve(count);
    mapping_.arms_.reserve(count);
  }

  template <class Place>
  void for_each_point(const std::vector<bool>& taking, const Place& place) {
    mapping_.starts_.reserve(from_.points.size() + 1);
    for (std::uint32_t point = 0; point < from_.points.size(); ++point) {
      if (taking[point] && !place(point, from_.points[point])) mapping_.unmapped_.push_back(point);
      mapping_.starts_.push_back(mapping_.nodes_.size());
    }
  }

  bool project(std::uint32_t point, const Vec3& x, const PartnerSearch& search, double max_distance) {
    const auto partner = search.nearest(x, max_distance);
    if (!partner) return false;
    const auto nodes = to_.nodes(partner->face);
    add(point, x, nodes, {partner->projection.weights.data(), nodes.size()}, nodes);
    note_distance(point, partner->projection.distance);
    return true;
  }

  /// @param carriers  of the couple, where x lies off the place that the weights give
  void add(std::uint32_t point, const Vec3& x, std::span<const std::uint32_t> nodes, std::span<const double> weights, std::span<const std::uint32_t> carriers) {
    // What `forces` does is Σ w_k x_k, whatever the search made of it.
    Vec3 projected = Vec3::Zero();
    for (std::size_t k = 0; k < nodes.size(); ++k) {
      // A point on a node or an edge leaves the others nothing but rounding; where the meshes match, this is most of them.
      if (std::abs(weights[k]) < std::numeric_limits<double>::epsilon()) continue;
      mapping_.nodes_.push_back(nodes[k]);
      mapping_.weights_.push_back(weights[k]);
      projected += weights[k] * to_.points[nodes[k]];
    }
    const Vec3 offset = x - projected;
    if (offset.norm() > round_off * extent_) add_couple(point, offset, carriers);
  }

  void note_distance(std::uint32_t point, double distance) {
    if (distance <= mapping_.worst_distance_) return;
    mapping_.worst_distance_ = distance;
    mapping_.worst_point_ = point;
  }

  void add_couple(std::uint32_t point, const Vec3& offset, std::span<const std::uint32_t> nodes) {
    const auto couples = unit_couples(offset);
    carriers_.assign(nodes.begin(), nodes.end());
    auto carrier = carrier_of(carriers_);
    if (loses(carrier, couples)) {
      spread(nodes);
      carrier = carrier_of(carriers_);
      ++(loses(carrier, couples) ? mapping_.couples_lost_ : mapping_.couples_spread_);
    }
    mapping_.couples_.push_back({point, carrier.compliance * couples});
    for (const auto node : carriers_) {
      mapping_.couple_nodes_.push_back(node);
      mapping_.arms_.push_back(to_.points[node] - carrier.centre);
    }
    mapping_.couple_starts_.push_back(mapping_.couple_nodes_.size());
  }

  Eigen::Matrix3d unit_couples(const Vec3& offset) const { return cross_matrix(offset) * forces_.asDiagonal(); }
  bool loses(const CoupleCarrier& carrier, const Eigen::Matrix3d& couples) const { return (carrier.lost * couples).norm() > lost_fraction * extent_; }

  CoupleCarrier carrier_of(std::span<const std::uint32_t> nodes) {
    positions_.clear();
    for (const auto node : nodes) positions_.push_back(to_.points[node]);
    return geometry::couple_carrier(positions_);
  }

  /// Adds the nodes of the faces that share a node with these.
  void spread(std::span<const std::uint32_t> given) {
    if (neighbours_.empty()) neighbours_.emplace_back(to_);
    for (const auto node : given)
      for (const auto other : neighbours_.front()[node]) {
        const auto nodes = to_.nodes(other);
        carriers_.insert(carriers_.end(), nodes.begin(), nodes.end());
      }
    std::sort(carriers_.begin(), carriers_.end());
    carriers_.erase(std::unique(carriers_.begin(), carriers_.end()), carriers_.end());
  }

  Mapping& mapping_;
  const SurfaceMesh &from_, &to_;
  double extent_;
  bool plane_;
  Vec3 forces_ = Vec3::Ones();  // which components a force may have
  std::vector<std::uint32_t> carriers_;
  std::vector<Vec3> positions_;
  std::vector<FacesAtNodes> neighbours_;  // built when the first thin face asks
};

Mapping::Mapping(const SurfaceMesh& from, const SurfaceMesh& to, const MappingOptions& options)
    : to_count_(to.points.size()) {
  if (!(options.max_distance > 0))
    throw std::invalid_argument("mapping: max_distance must be above zero");
  if (!options.own.empty()) check_length(options.own.size(), from.points.size(), "points of the sending surface");
  auto taking = carrying_points(from);
  for (std::uint32_t point = 0; point < from.points.size(); ++point) {
    if (!options.own.empty()) taking[point] = taking[point] && options.own[point];
    if (taking[point] && !from.points[point].allFinite())
      throw std::invalid_argument("mapping: point " + std::to_string(point) + " of the sending surface has a coordinate that is not a finite number");
  }
  Builder builder(*this, from, to);
  switch (options.kind) {
    case MappingKind::conservative: builder.by_projection(taking, options.max_distance); break;
    case MappingKind::overlap: builder.by_overlap(taking, options.max_distance); break;
    case MappingKind::nearest: builder.by_nearest_node(taking, options.max_distance); break;
  }
}

void Mapping::shares(std::span<const Vec3> from, std::span<Vec3> to) const {
  check_length(from.size(), from_count(), "points of the sending surface");
  check_length(to.size(), to_count_, "nodes of the receiving surface");
  std::fill(to.begin(), to.end(), Vec3::Zero());
  for (std::size_t point = 0; point < from.size(); ++point)
    for (auto k = starts_[point]; k < starts_[point + 1]; ++k)
      to[nodes_[k]] += weights_[k] * from[point];
}

void Mapping::forces(std::span<const Vec3> from, std::span<Vec3> to) const {
  shares(from, to);
  for (std::size_t c = 0; c < couples_.size(); ++c) {
    const Vec3 turn = couples_[c].turn * from[couples_[c].point];
    for (auto k = couple_starts_[c]; k < couple_starts_[c + 1]; ++k)
      to[couple_nodes_[k]] += turn.cross(arms_[k]);
  }
}

void Mapping::values(std::span<const Vec3> to, std::span<Vec3> from) const {
  check_length(from.size(), from_count(), "points of the sending surface");
  check_length(to.size(), to_count_, "nodes of the receiving surface");
  for (std::size_t point = 0; point < from.size(); ++point) {
    Vec3 value = Vec3::Zero();
    for (auto k = starts_[point]; k < starts_[point + 1]; ++k) value += weights_[k] * to[nodes_[k]];
    from[point] = value;
  }
}

void Mapping::conjugate_values(std::span<const Vec3> to, std::span<Vec3> from) const {
  values(to, from);
  for (std::size_t c = 0; c < couples_.size(); ++c) {
    // u · ((A f) × d) = f · Aᵀ (d × u)
    Vec3 moment = Vec3::Zero();
    for (auto k = couple_starts_[c]; k < couple_starts_[c + 1]; ++k)
      moment += arms_[k].cross(to[couple_nodes_[k]]);
    from[couples_[c].point] += couples_[c].turn.transpose() * moment;
  }
}

}  // namespace acopla::coupler
