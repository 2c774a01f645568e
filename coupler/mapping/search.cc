#include "coupler/mapping/search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace acopla::coupler {
namespace {

using geometry::Box;

using FaceNodes = std::array<Vec3, max_face_nodes>;

std::span<const Vec3> nodes_of_face(const geometry::SurfaceMesh& surface, std::size_t face,
                                    FaceNodes& storage) {
  const auto nodes = surface.nodes(face);
  for (std::size_t k = 0; k < nodes.size(); ++k) storage[k] = surface.points[nodes[k]];
  return {storage.data(), nodes.size()};
}

std::vector<Box> boxes_of_faces(const geometry::SurfaceMesh& surface) {
  std::vector<Box> boxes(surface.face_count());
  FaceNodes storage;
  for (std::size_t face = 0; face < boxes.size(); ++face)
    boxes[face] = box_of_face(surface.kind(face), nodes_of_face(surface, face, storage));
  return boxes;
}

double distance_to(const Box& box, const Vec3& x) {
  return (box.low - x).cwiseMax(x - box.high).cwiseMax(0.0).norm();
}

/// Distances already computed for a point, so that the widening boxes do not project on a face
/// twice. It holds the last 32, far more than most points need; forgetting one costs time and
/// nothing else.
class Examined {
 public:
  const double* find(std::uint32_t face) const {
    const std::size_t held = std::min(count_, faces_.size());
    for (std::size_t k = 0; k < held; ++k)
      if (faces_[k] == face) return &distances_[k];
    return nullptr;
  }
  bool forgot() const { return count_ > faces_.size(); }
  /// The lowest face within a distance, of those held.
  std::uint32_t lowest_within(double distance, std::uint32_t lowest) const {
    for (std::size_t k = 0; k < std::min(count_, faces_.size()); ++k)
      if (distances_[k] <= distance) lowest = std::min(lowest, faces_[k]);
    return lowest;
  }
  void put(std::uint32_t face, double distance) {
    const std::size_t place = count_++ % faces_.size();
    faces_[place] = face;
    distances_[place] = distance;
  }

 private:
  std::size_t count_ = 0;
  std::array<std::uint32_t, 32> faces_;
  std::array<double, 32> distances_;
};

}  // namespace

PartnerSearch::PartnerSearch(const geometry::SurfaceMesh& surface)
    : surface_(surface), boxes_(boxes_of_faces(surface)), grid_(boxes_) {
  tie_ = 1e-12 * (grid_.bounds().high - grid_.bounds().low).norm();
}

FaceProjection PartnerSearch::project(std::uint32_t face, const Vec3& x) const {
  FaceNodes storage;
  return project_on_face(surface_.kind(face), nodes_of_face(surface_, face, storage), x);
}

std::optional<std::uint32_t> PartnerSearch::nearest_middle(const Vec3& x, double reach) const {
  std::optional<std::uint32_t> nearest;
  double least = std::numeric_limits<double>::infinity();
  const Vec3 half = Vec3::Constant(reach + tie_);
  grid_.for_each_near(x - half, x + half, [&](std::uint32_t face) {
    const double square = (0.5 * (boxes_[face].low + boxes_[face].high) - x).squaredNorm();
    if (square >= least) return;
    least = square;
    nearest = face;
  });
  return nearest;
}

std::optional<Partner> PartnerSearch::nearest(const Vec3& x, double max_distance, std::optional<std::uint32_t> guess) const {
  if (boxes_.empty() || !x.allFinite()) return {};
  Partner partner;
  Examined known;
  double least = std::numeric_limits<double>::infinity();
  const auto distance_of = [&](std::uint32_t face) {
    if (const double* distance = known.find(face)) return *distance;
    const auto projection = project(face, x);
    ++partner.examined;
    known.put(face, projection.distance);
    if (projection.distance < least) {
      least = projection.distance;
      partner.face = face;
      partner.projection = projection;
    }
    return projection.distance;
  };
  const auto for_each_within = [&](double reach, auto&& visit) {
    const Vec3 half = Vec3::Constant(reach + 2 * tie_);
    grid_.for_each_near(x - half, x + half, visit);
  };

  // The least distance: widen the box until nothing outside it can be nearer than what is inside.
  // It starts far below a bucket: most points lie almost on the surface, and one bucket then offers
  // a bound at once.
  const auto near_enough = [&](std::uint32_t face) {
    return distance_to(boxes_[face], x) <= std::min(least, max_distance) + 2 * tie_;
  };
  double half = std::max(0.03 * grid_.smallest_size(), distance_to(grid_.bounds(), x));
  if (guess && distance_of(*guess) <= grid_.size()) half = std::max(half, least);  // a bad guess must not open a wide box
  while (true) {
    const double reach = std::min(half, max_distance);
    if (!std::isfinite(least))
      if (const auto seed = nearest_middle(x, reach)) distance_of(*seed);
    for_each_within(reach, [&](std::uint32_t face) {
      if (near_enough(face)) distance_of(face);
    });
    if (least <= reach || !(reach < max_distance)) break;
    half = std::min(least, 4 * half);
  }
  if (!(least <= max_distance)) return {};

  // The lowest index among all that lie as near, which have all been examined.
  const double as_near = least + tie_;
  auto lowest = known.lowest_within(as_near, partner.face);
  if (known.forgot())
    for_each_within(as_near, [&](std::uint32_t face) {
      if (face < lowest && distance_to(boxes_[face], x) <= as_near + tie_ && distance_of(face) <= as_near) lowest = face;
    });
  if (lowest != partner.face) {
    partner.face = lowest;
    partner.projection = project(lowest, x);
  }
  return partner;
}

std::optional<Partner> PartnerSearch::nearest_exhaustive(const Vec3& x, double max_distance) const {
  if (boxes_.empty() || !x.allFinite()) return {};
  std::vector<double> distances(boxes_.size());
  for (std::uint32_t face = 0; face < boxes_.size(); ++face)
    distances[face] = project(face, x).distance;
  const double least = *std::min_element(distances.begin(), distances.end());
  if (!(least <= max_distance)) return {};
  Partner partner;
  while (distances[partner.face] > least + tie_) ++partner.face;
  partner.projection = project(partner.face, x);
  partner.examined = static_cast<std::uint32_t>(boxes_.size());
  return partner;
}

}  // namespace acopla::coupler
