#include "dem/wall/touching.h"

#include <algorithm>
#include <cmath>

namespace acopla::dem {
namespace {

bool holds(const std::array<std::uint32_t, 3>& triangle, std::uint32_t vertex) {
  return triangle[0] == vertex || triangle[1] == vertex || triangle[2] == vertex;
}

bool holds_feature(const WallSet& walls, std::uint32_t element, const NearestPoint& contact) {
  if (!walls.is_facet(element)) return false;
  const auto& triangle = walls.facet(element);
  for (std::uint8_t k = 0; k < contact.feature_size; ++k)
    if (!holds(triangle, contact.feature[k])) return false;
  return contact.feature_size > 0;
}

struct Crease {
  double share = 0;        // m
  double q_a = 1, q_b = 1; // feet's distances from the crease, up to a common factor
};

Crease crease_of(double radius, const NearestPoint& a, const NearestPoint& b) {
  const double cosine = a.normal.dot(b.normal);
  const double square = 1 - cosine * cosine;
  if (cosine <= 0) return {};  // faces that look at each other never share a patch
  if (square < 1e-24) return {1, 1, 1};
  const double q_a = b.distance - cosine * a.distance, q_b = a.distance - cosine * b.distance;
  if (q_a <= 0 || q_b <= 0) return {};
  const double to_crease = std::sqrt((a.distance * a.distance + b.distance * b.distance - 2 * cosine * a.distance * b.distance) / square);
  const double least = radius - std::max(a.distance, b.distance);
  return {std::clamp((radius - to_crease) / least, 0.0, 1.0), q_a, q_b};
}

}  // namespace

double crease_share(double radius, const NearestPoint& a, const NearestPoint& b) { return crease_of(radius, a, b).share; }

void keep_contacts(const WallSet& walls, double radius, std::vector<NearestPoint>& found) {
  if (found.size() < 2) return;
  std::sort(found.begin(), found.end(), [](const NearestPoint& a, const NearestPoint& b) {
    return std::pair(a.distance, a.element) < std::pair(b.distance, b.element);
  });
  const double same = 1e-18 * radius * radius;  // (1e-9 r)²
  std::size_t kept = 1;
  for (std::size_t k = 1; k < found.size(); ++k) {
    const auto& contact = found[k];
    bool own = true;
    // Against all nearer elements, kept or not: a chain of triangles may lead from here to the true minimum. `found`
    // is compacted behind k, so their elements are looked up before they are overwritten.
    for (std::size_t n = 0; n < kept && own; ++n)
      own = (found[n].point - contact.point).squaredNorm() > same && !holds_feature(walls, found[n].element, contact);
    for (std::size_t n = k; n-- > 0 && own && contact.feature_size > 0;)
      own = !holds_feature(walls, found[n].element, contact);
    if (own) {
      if (kept != k) std::swap(found[kept], found[k]);
      ++kept;
    }
  }
  found.resize(kept);
}

void share_creases(double radius, std::span<const NearestPoint> contacts, std::span<double> weights) {
  for (auto& weight : weights) weight = 1;
  if (contacts.size() < 2) return;
  for (std::size_t a = 0; a < contacts.size(); ++a) {
    double sum = 1;
    for (std::size_t b = 0; b < contacts.size(); ++b) {
      if (a == b) continue;
      const auto crease = crease_of(radius, contacts[a], contacts[b]);
      if (crease.share > 0) sum += crease.share * crease.q_b / crease.q_a;
    }
    weights[a] = 1 / sum;
  }
}

}  // namespace acopla::dem
