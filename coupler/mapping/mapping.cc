#include "coupler/mapping/mapping.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "coupler/mapping/search.h"
#include "geometry/couple.h"

namespace acopla::coupler {
namespace {

using geometry::CoupleCarrier;
using geometry::SurfaceMesh;

constexpr double round_off =
    1e-15;  // of the surface's extent: nearer than this a point lies on its face
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

/// Fills a mapping point by point.
class Mapping::Builder {
 public:
  Builder(Mapping& mapping, const SurfaceMesh& from, const SurfaceMesh& to)
      : mapping_(mapping), to_(to), extent_(to.extent()) {
    if (plane(from) && plane(to)) forces_.z() = 0;
  }

  void add(std::uint32_t point, const Vec3& x, const Partner& partner) {
    const auto nodes = to_.nodes(partner.face);
    // What `forces` does is Σ w_k x_k, whatever the search made of it.
    Vec3 projected = Vec3::Zero();
    for (std::size_t k = 0; k < nodes.size(); ++k) {
      // A point on a node or an edge leaves the others nothing but rounding; where the meshes match, this is most of them.
      if (std::abs(partner.projection.weights[k]) < std::numeric_limits<double>::epsilon()) continue;
      mapping_.nodes_.push_back(nodes[k]);
      mapping_.weights_.push_back(partner.projection.weights[k]);
      projected += partner.projection.weights[k] * to_.points[nodes[k]];
    }
    const Vec3 offset = x - projected;
    const double distance = offset.norm();
    if (distance > mapping_.worst_distance_) {
      mapping_.worst_distance_ = distance;
      mapping_.worst_point_ = point;
    }
    if (distance > round_off * extent_) add_couple(point, offset, partner.face);
  }

 private:
  void add_couple(std::uint32_t point, const Vec3& offset, std::uint32_t face) {
    const Eigen::Matrix3d couples = cross_matrix(offset) * forces_.asDiagonal();  // of unit forces
    const auto loses = [&](const CoupleCarrier& carrier) {
      return (carrier.lost * couples).norm() > lost_fraction * extent_;
    };
    const auto nodes = to_.nodes(face);
    carriers_.assign(nodes.begin(), nodes.end());
    auto carrier = carrier_of(carriers_);
    if (loses(carrier)) {
      spread(face);
      carrier = carrier_of(carriers_);
      ++(loses(carrier) ? mapping_.couples_lost_ : mapping_.couples_spread_);
    }
    mapping_.couples_.push_back({point, carrier.compliance * couples});
    for (const auto node : carriers_) {
      mapping_.couple_nodes_.push_back(node);
      mapping_.arms_.push_back(to_.points[node] - carrier.centre);
    }
    mapping_.couple_starts_.push_back(mapping_.couple_nodes_.size());
  }

  CoupleCarrier carrier_of(std::span<const std::uint32_t> nodes) {
    positions_.clear();
    for (const auto node : nodes) positions_.push_back(to_.points[node]);
    return geometry::couple_carrier(positions_);
  }

  /// Adds the nodes of the faces that share a node with this one.
  void spread(std::uint32_t face) {
    if (neighbours_.empty()) neighbours_.emplace_back(to_);
    for (const auto node : to_.nodes(face))
      for (const auto other : neighbours_.front()[node]) {
        const auto nodes = to_.nodes(other);
        carriers_.insert(carriers_.end(), nodes.begin(), nodes.end());
      }
    std::sort(carriers_.begin(), carriers_.end());
    carriers_.erase(std::unique(carriers_.begin(), carriers_.end()), carriers_.end());
  }

  Mapping& mapping_;
  const SurfaceMesh& to_;
  double extent_;
  Vec3 forces_ = Vec3::Ones();  // which components a force may have
  std::vector<std::uint32_t> carriers_;
  std::vector<Vec3> positions_;
  std::vector<FacesAtNodes> neighbours_;  // built when the first thin face asks
};

Mapping::Mapping(const SurfaceMesh& from, const SurfaceMesh& to, const MappingOptions& options)
    : to_count_(to.points.size()) {
  if (!(options.max_distance > 0))
    throw std::invalid_argument("mapping: max_distance must be above zero");
  const auto carrying = carrying_points(from);
  const PartnerSearch search(to);
  Builder builder(*this, from, to);
  starts_.reserve(from.points.size() + 1);
  for (std::uint32_t point = 0; point < from.points.size(); ++point) {
    const Vec3& x = from.points[point];
    if (carrying[point]) {
      if (!x.allFinite())
        throw std::invalid_argument(
            "mapping: point " + std::to_string(point) +
            " of the sending surface has a coordinate that is not a finite number");
      if (const auto partner = search.nearest(x, options.max_distance))
        builder.add(point, x, *partner);
      else
        unmapped_.push_back(point);
    }
    starts_.push_back(nodes_.size());
  }
}

void Mapping::forces(std::span<const Vec3> from, std::span<Vec3> to) const {
  check_length(from.size(), from_count(), "points of the sending surface");
  check_length(to.size(), to_count_, "nodes of the receiving surface");
  std::fill(to.begin(), to.end(), Vec3::Zero());
  for (std::size_t point = 0; point < from.size(); ++point)
    for (auto k = starts_[point]; k < starts_[point + 1]; ++k)
      to[nodes_[k]] += weights_[k] * from[point];
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
