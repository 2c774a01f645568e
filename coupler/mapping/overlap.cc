#include "coupler/mapping/overlap.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

namespace acopla::coupler {
namespace {

using geometry::SurfaceMesh;
using FaceVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, max_face_nodes, 1>;
using FaceMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, max_face_nodes, max_face_nodes>;

constexpr double least_cosine = 0.5;   // of the angle between two faces that may cover each other
constexpr double nearly_as_far = 0.25; // of a face's size: farther than the nearest face by this, another face is another side

constexpr double least_cover = 1e-6;   // of a point's control surface: below it nothing lies over it

constexpr double no_more_than_an_edge = 1e-12;  // of a face's measure: faces that only touch along an edge
constexpr double on_the_line = 1e-12;  // over a line's length
constexpr double almost_all = 1e-9;    // of a face: less than this is missing to round-off only

/// A linear piece of a face of `from`: two or three corners, each a node or the mean of some.
struct Piece {
  struct Corner {
    Vec3 at;
    std::array<std::size_t, 4> nodes;  // of the face
    std::size_t count;                 // of these, of equal weight
  };
  std::array<Corner, 3> corners;
  std::size_t count;  // of corners: 2 in the plane, 3 in space
};

template <class Visit>
void for_each_piece(const SurfaceMesh& surface, std::size_t face, const Visit& visit) {
  const auto nodes = surface.nodes(face);
  const auto corner = [&](std::size_t k) { return Piece::Corner{surface.points[nodes[k]], {k}, 1}; };
  const auto triangle = [&](std::size_t a, std::size_t b, std::size_t c) { visit(Piece{{corner(a), corner(b), corner(c)}, 3}); };
  switch (surface.kind(face)) {
    case FaceKind::line2: visit(Piece{{corner(0), corner(1), corner(1)}, 2}); break;
    case FaceKind::line3:
      visit(Piece{{corner(0), corner(2), corner(2)}, 2});
      visit(Piece{{corner(2), corner(1), corner(1)}, 2});
      break;
    case FaceKind::triangle3: triangle(0, 1, 2); break;
    case FaceKind::triangle6:
      triangle(0, 3, 5), triangle(3, 1, 4), triangle(5, 4, 2), triangle(3, 4, 5);
      break;
    case FaceKind::quad4: {
      Piece::Corner centre{Vec3::Zero(), {0, 1, 2, 3}, 4};
      for (const auto node : nodes) centre.at += 0.25 * surface.points[node];
      for (std::size_t k = 0; k < 4; ++k) visit(Piece{{corner(k), corner((k + 1) % 4), centre}, 3});
      break;
    }
    case FaceKind::quad9:
      for (std::size_t k = 0; k < 4; ++k) triangle(k, 4 + k, 8), triangle(4 + k, (k + 1) % 4, 8);
      break;
  }
}

/// A plane of coordinates (s, t) through a piece; in two dimensions the line of it, where t says nothing.
struct Frame {
  Vec3 origin, s, t;
  Vec2 operator()(const Vec3& x) const { return {s.dot(x - origin), t.dot(x - origin)}; }
  Vec3 at(const Vec2& p) const { return origin + p[0] * s + p[1] * t; }
};

double cross(const Vec2& a, const Vec2& b) { return a[0] * b[1] - a[1] * b[0]; }

/// What three cuts leave of a face of four corners at most: each doubles the corners at worst, though it adds one where round-off leaves them convex.
class Polygon {
 public:
  std::size_t size() const { return size_; }
  const Vec2& operator[](std::size_t k) const { return corners_[k]; }
  void push_back(const Vec2& p) { corners_[size_++] = p; }
  void reverse() { std::reverse(corners_.begin(), corners_.begin() + static_cast<std::ptrdiff_t>(size_)); }

  /// Keeps what lies left of the line from a to b (Sutherland & Hodgman 1974).
  void clip(const Vec2& a, const Vec2& b) {
    const Vec2 along = b - a;
    const double least = on_the_line * along.squaredNorm();  // below it round-off would cut an edge that lies along the line anywhere
    std::array<double, room> side;
    bool cut = false;
    for (std::size_t k = 0; k < size_; ++k) {
      const double value = cross(along, corners_[k] - a);
      side[k] = std::abs(value) > least ? value : 0;
      cut = cut || side[k] < 0;
    }
    if (!cut) return;
    Polygon left;
    for (std::size_t k = 0; k < size_; ++k) {
      const std::size_t next = k + 1 < size_ ? k + 1 : 0;
      const double at_p = side[k], at_q = side[next];
      if (at_p >= 0) left.push_back(corners_[k]);
      if ((at_p > 0 && at_q < 0) || (at_p < 0 && at_q > 0)) left.push_back(corners_[k] + at_p / (at_p - at_q) * (corners_[next] - corners_[k]));
    }
    size_ = left.size_;
    std::copy_n(left.corners_.begin(), size_, corners_.begin());
  }
  /// The same for the inside of a triangle that turns counter-clockwise.
  void clip(const std::array<Vec2, 3>& triangle) {
    for (std::size_t k = 0; k < 3 && size_ > 2; ++k) clip(triangle[k], triangle[(k + 1) % 3]);
  }

 private:
  static constexpr std::size_t room = 32;
  std::array<Vec2, room> corners_;
  std::size_t size_ = 0;
};

/// Of a convex polygon; none of one with less than this area, which is round-off beside an edge.
std::optional<Vec2> centroid(const Polygon& polygon, double least) {
  double area = 0;
  Vec2 moment = Vec2::Zero();
  for (std::size_t k = 0; k + 2 < polygon.size(); ++k) {
    const double twice = cross(polygon[k + 1] - polygon[0], polygon[k + 2] - polygon[0]);
    area += twice;
    moment += twice / 3 * (polygon[0] + polygon[k + 1] + polygon[k + 2]);
  }
  if (!(area > least)) return std::nullopt;
  return Vec2(moment / area);
}

struct QuadraturePoint {
  std::array<double, 3> place;  // barycentric
  double weight;
};

// Exact for degree 2: hat function times linear shape function.
constexpr std::array<QuadraturePoint, 3> three_points{{{{2. / 3, 1. / 6, 1. / 6}, 1. / 3}, {{1. / 6, 2. / 3, 1. / 6}, 1. / 3}, {{1. / 6, 1. / 6, 2. / 3}, 1. / 3}}};
// Exact for degree 5 (Radon 1948): hat function times biquadratic shape function.
const std::array<QuadraturePoint, 7> seven_points = [] {
  const double r = std::sqrt(15.), a = (6 - r) / 21, b = (6 + r) / 21, wa = (155 - r) / 1200, wb = (155 + r) / 1200;
  return std::array<QuadraturePoint, 7>{{{{1. / 3, 1. / 3, 1. / 3}, 9. / 40},
                                         {{1 - 2 * a, a, a}, wa}, {{a, 1 - 2 * a, a}, wa}, {{a, a, 1 - 2 * a}, wa},
                                         {{1 - 2 * b, b, b}, wb}, {{b, 1 - 2 * b, b}, wb}, {{b, b, 1 - 2 * b}, wb}}};
}();
// Exact for degree 3 (Strang & Fix 1973): hat function times bilinear or quadratic shape function of an affine face.
constexpr std::array<QuadraturePoint, 4> four_points{{{{1. / 3, 1. / 3, 1. / 3}, -27. / 48}, {{.6, .2, .2}, 25. / 48}, {{.2, .6, .2}, 25. / 48}, {{.2, .2, .6}, 25. / 48}}};
// Gauss's three points on [0, 1], exact for degree 5.
const std::array<std::array<double, 2>, 3> line_points = [] {
  const double h = 0.5 * std::sqrt(0.6);
  return std::array<std::array<double, 2>, 3>{{{0.5 - h, 5. / 18}, {0.5, 8. / 18}, {0.5 + h, 5. / 18}}};
}();

/// Gathers ∫ N_i N_k dA, face of `from` by face.
class Integration {
 public:
  Integration(const SurfaceMesh& from, const SurfaceMesh& to, const PartnerSearch& search, double max_distance)
      : from_(from), to_(to), search_(search), max_distance_(max_distance), whole_(from.points.size(), 0.0) {
    parts_.reserve(from.connectivity().size());
    part_nodes_.reserve(12 * from.face_count());
    part_values_.reserve(12 * from.connectivity().size());  // nodes under a face of about the same size; what is never written costs nothing
    affine_.reserve(to.face_count());
    for (std::size_t face = 0; face < to.face_count(); ++face) affine_.push_back(is_affine(to, face));
  }

  Overlap rows() {
    for (std::size_t face = 0; face < from_.face_count(); ++face) {
      const auto size = std::ssize(from_.nodes(face));
      hats_.setZero(size, size);
      from_kind_ = from_.kind(face);
      under_.clear();
      shares_.clear();
      for_each_piece(from_, face, [&](const Piece& piece) { add(piece); });
      enter(from_.nodes(face));
    }
    // By point; a node's value is what one face after another gives it.
    const auto points = from_.points.size();
    std::vector<std::size_t> starts(points + 1, 0);
    for (const auto& part : parts_) ++starts[part.point + 1];
    for (std::size_t k = 1; k < starts.size(); ++k) starts[k] += starts[k - 1];
    std::vector<std::size_t> sorted(parts_.size());
    auto next = starts;
    for (std::size_t k = 0; k < parts_.size(); ++k) sorted[next[parts_[k].point]++] = k;
    Overlap result;
    result.starts.reserve(points + 1);
    result.nodes.reserve(part_values_.size());
    result.weights.reserve(part_values_.size());
    std::vector<std::size_t> places(to_.points.size(), 0);  // of the nodes in the result, where they have one in the present row
    for (std::uint32_t point = 0; point < points; ++point) {
      const auto start = result.starts.back();
      double sum = 0;
      for (auto k = starts[point]; k < starts[point + 1]; ++k) {
        const auto& part = parts_[sorted[k]];
        for (std::size_t n = 0; n < part.count; ++n) {
          const auto node = part_nodes_[part.nodes + n];
          const double value = part_values_[part.values + n];
          sum += value;
          auto& place = places[node];
          if (place < start || place >= result.nodes.size() || result.nodes[place] != node) {
            place = result.nodes.size();
            result.nodes.push_back(node);
            result.weights.push_back(0);
          }
          result.weights[place] += value;
        }
      }
      if (!(sum > least_cover * whole_[point])) {  // a hair's breadth says nothing about where a force goes
        result.nodes.resize(start);
        result.weights.resize(start);
      }
      for (auto k = start; k < result.weights.size(); ++k) result.weights[k] /= sum;
      result.starts.push_back(result.nodes.size());
    }
    return result;
  }

 private:
  /// What a face of `from` adds to the row of one of its points.
  struct Part {
    std::uint32_t point, count;  // of nodes
    std::size_t nodes, values;   // the first of them
  };

  void add(const Piece& piece) {
    const auto& c = piece.corners;
    const Vec3 edge = c[1].at - c[0].at;
    const double length = edge.norm();
    if (!(length > 0)) return;
    Frame frame{c[0].at, edge / length, Vec3::Zero()};
    Vec3 normal = Vec3::Zero();
    double size = length, measure = length;  // of the piece [m], [m²]
    if (piece.count == 3) {
      const Vec3 area = edge.cross(c[2].at - c[0].at);
      if (!(area.norm() > 0)) return;
      normal = area.normalized();
      frame.t = normal.cross(frame.s);
      measure = 0.5 * area.norm();
      size = std::sqrt(2 * measure);
    }
    add_mass(piece, measure);
    Vec3 middle = Vec3::Zero();
    for (std::size_t k = 0; k < piece.count; ++k) middle += c[k].at / static_cast<double>(piece.count);
    const auto nearest = search_.nearest(middle, max_distance_, nearest_);
    if (!nearest) return;
    nearest_ = nearest->face;
    const double farthest = std::min(max_distance_, nearest->projection.distance + nearly_as_far * size);

    Vec3 low = c[0].at, high = low;
    for (std::size_t k = 1; k < piece.count; ++k) low = low.cwiseMin(c[k].at), high = high.cwiseMax(c[k].at);
    near_.clear();
    search_.for_each_touching(low - Vec3::Constant(farthest), high + Vec3::Constant(farthest), [&](std::uint32_t face) { near_.push_back(face); });
    std::sort(near_.begin(), near_.end());
    near_.erase(std::unique(near_.begin(), near_.end()), near_.end());
    for (const auto face : near_) {
      points_.clear();
      for (const auto node : to_.nodes(face)) points_.push_back(to_.points[node]);
      if (piece.count == 2) cover_line(piece, frame, length, face, farthest);
      else cover(piece, frame, normal, face, farthest);
    }
  }

  void cover_line(const Piece& piece, const Frame& frame, double length, std::uint32_t face, double farthest) {
    const auto kind = to_.kind(face);
    if (geometry::corners_of(kind) != 2) return;
    const Vec3 along = points_[1] - points_[0];
    if (!(std::abs(along.dot(frame.s)) >= least_cosine * along.norm()) || along.norm() == 0) return;
    for_each_piece(to_, face, [&](const Piece& under) {
      const double a = frame(under.corners[0].at)[0], b = frame(under.corners[1].at)[0];
      const double low = std::max(0.0, std::min(a, b)), high = std::min(length, std::max(a, b));
      if (!(high - low > no_more_than_an_edge * length)) return;
      const auto shapes_at = [&](double s) {
        const double share = (s - a) / (b - a);
        return located(kind, frame, {s, 0}, (1 - share) * parameters(kind, under.corners[0]) + share * parameters(kind, under.corners[1]));
      };
      if (distance(shapes_at(0.5 * (low + high)), frame.at({0.5 * (low + high), 0})) > farthest) return;
      begin(face);
      for (const auto& [place, weight] : line_points) {
        const double s = low + place * (high - low);
        gather({1 - s / length, s / length, 0}, piece.count, shapes_at(s), weight * (high - low));
      }
      enter(piece);
    });
  }

  void cover(const Piece& piece, const Frame& frame, const Vec3& normal, std::uint32_t face, double farthest) {
    const auto kind = to_.kind(face);
    if (geometry::corners_of(kind) < 3) return;
    const std::array<Vec2, 3> corners{frame(piece.corners[0].at), frame(piece.corners[1].at), frame(piece.corners[2].at)};
    const double whole = cross(corners[1] - corners[0], corners[2] - corners[0]);
    if (affine_[face]) return cover_affinely(piece, frame, normal, corners, whole, face, farthest);
    for_each_piece(to_, face, [&](const Piece& under) {
      const Vec3 area = (under.corners[1].at - under.corners[0].at).cross(under.corners[2].at - under.corners[0].at);
      if (!(std::abs(area.dot(normal)) >= least_cosine * area.norm()) || area.norm() == 0) return;
      std::array<Vec2, 3> triangle;
      for (std::size_t k = 0; k < 3; ++k) triangle[k] = frame(under.corners[k].at);
      const double turn = cross(triangle[1] - triangle[0], triangle[2] - triangle[0]);
      Polygon polygon;
      for (const auto& p : triangle) polygon.push_back(p);
      if (turn < 0) polygon.reverse();
      polygon.clip(corners);
      if (polygon.size() < 3) return;

      const std::array<Vec2, 3> at_corners{parameters(kind, under.corners[0]), parameters(kind, under.corners[1]), parameters(kind, under.corners[2])};
      const auto shapes_at = [&](const Vec2& p) {
        const double first = cross(triangle[1] - p, triangle[2] - p) / turn, second = cross(triangle[2] - p, triangle[0] - p) / turn;
        return located(kind, frame, p, first * at_corners[0] + second * at_corners[1] + (1 - first - second) * at_corners[2]);
      };
      const auto middle = centroid(polygon, no_more_than_an_edge * whole);
      if (!middle || distance(shapes_at(*middle), frame.at(*middle)) > farthest) return;
      begin(face);
      const auto take = [&](const Vec2& p, double weight) {
        const double first = cross(corners[1] - p, corners[2] - p) / whole, second = cross(corners[2] - p, corners[0] - p) / whole;
        gather({first, second, 1 - first - second}, 3, shapes_at(p), weight);
      };
      // A fan about the middle: which corner comes first is a matter of round-off, where two faces share an edge.
      for (std::size_t k = 0; k < polygon.size(); ++k) {
        const Vec2 &a = *middle, &b = polygon[k], &c = polygon[(k + 1) % polygon.size()];
        const double half = 0.5 * cross(b - a, c - a);
        const auto add_all = [&](const auto& rule) {
          for (const auto& [place, weight] : rule) take(place[0] * a + place[1] * b + place[2] * c, weight * half);
        };
        add_all(seven_points);
      }
      enter(piece);
    });
  }

  /// A triangle, or a parallelogram, whose middles are in the middle: its parameters are linear in the place.
  static bool is_affine(const SurfaceMesh& surface, std::size_t face) {
    const auto kind = surface.kind(face);
    const auto nodes = surface.nodes(face);
    const auto corners = geometry::corners_of(kind);
    if (kind == FaceKind::triangle3) return true;
    if (corners < 3) return false;
    const auto point = [&](std::size_t k) -> const Vec3& { return surface.points[nodes[k]]; };
    const Vec3 u = point(1) - point(0), v = point(corners - 1) - point(0);
    const double slack = 1e-12 * (u.norm() + v.norm());
    if (corners == 4 && (point(2) - point(0) - u - v).norm() > slack) return false;
    for (std::size_t k = corners; k < nodes.size(); ++k) {
      const auto& at = node_parameters(kind)[k];
      const double s = corners == 4 ? 0.5 * (1 + at[0]) : at[0], t = corners == 4 ? 0.5 * (1 + at[1]) : at[1];
      if ((point(k) - point(0) - s * u - t * v).norm() > slack) return false;
    }
    return true;
  }

  /// The same for such a face in one polygon, which the quadrature integrates exactly.
  void cover_affinely(const Piece& piece, const Frame& frame, const Vec3& normal, const std::array<Vec2, 3>& corners, double whole, std::uint32_t face, double farthest) {
    const auto kind = to_.kind(face);
    const auto count = geometry::corners_of(kind);
    const Vec3 u = points_[1] - points_[0], v = points_[count - 1] - points_[0], area = u.cross(v);
    if (!(std::abs(area.dot(normal)) >= least_cosine * area.norm()) || area.norm() == 0) return;
    const Vec2 origin = frame(points_[0]), along = frame(points_[1]) - origin, across = frame(points_[count - 1]) - origin;
    const double turn = cross(along, across);
    Polygon polygon;
    for (std::size_t k = 0; k < count; ++k) polygon.push_back(frame(points_[k]));
    if (turn < 0) polygon.reverse();
    polygon.clip(corners);
    if (polygon.size() < 3) return;
    const auto middle = centroid(polygon, no_more_than_an_edge * whole);
    if (!middle) return;
    const double per_turn = 1 / turn, per_whole = 1 / whole;
    const auto place = [&](const Vec2& p) { return Vec2(per_turn * cross(p - origin, across), per_turn * cross(along, p - origin)); };
    const Vec2 share = place(*middle);
    if ((points_[0] + share[0] * u + share[1] * v - frame.at(*middle)).norm() > farthest) return;
    begin(face);
    const auto take = [&](const Vec2& p, double weight) {
      const double first = per_whole * cross(corners[1] - p, corners[2] - p), second = per_whole * cross(corners[2] - p, corners[0] - p);
      const Vec2 at = place(p);
      gather({first, second, 1 - first - second}, 3, shape_functions(kind, count == 4 ? Vec2(2 * at[0] - 1, 2 * at[1] - 1) : at), weight);
    };
    for (std::size_t k = 1; k + 1 < polygon.size(); ++k) {
      const Vec2 &a = polygon[0], &b = polygon[k], &c = polygon[k + 1];
      const double half = 0.5 * cross(b - a, c - a);
      const auto add_all = [&](const auto& rule) {
        for (const auto& [at, weight] : rule) take(at[0] * a + at[1] * b + at[2] * c, weight * half);
      };
      switch (kind) {
        case FaceKind::triangle3: add_all(three_points); break;
        case FaceKind::quad9: add_all(seven_points); break;
        default: add_all(four_points);
      }
    }
    enter(piece);
  }

  static Vec2 parameters(FaceKind kind, const Piece::Corner& corner) {
    Vec2 mean = Vec2::Zero();
    for (std::size_t n = 0; n < corner.count; ++n) mean += node_parameters(kind)[corner.nodes[n]] / static_cast<double>(corner.count);
    return mean;
  }

  /// Shape functions of the face of `to` where it lies over the point p of the frame: by Newton's method from where its linear pieces have it, which
  /// is the answer already on affine faces. Not held inside the face, whose curved edge may stand beside its straight pieces: so the result is smooth.
  FaceValues located(FaceKind kind, const Frame& frame, const Vec2& p, Vec2 at) const {
    auto basis = shape_basis(kind, at);
    const bool line = geometry::corners_of(kind) == 2;
    if (kind == FaceKind::line2) return basis.value;
    constexpr int enough = 10;  // steps; four do nearly always, as the pieces are near
    for (int step = 0; step < enough; ++step) {
      Vec3 x = Vec3::Zero(), by_u = x, by_v = x;
      for (std::size_t k = 0; k < points_.size(); ++k) x += basis.value[k] * points_[k], by_u += basis.u[k] * points_[k], by_v += basis.v[k] * points_[k];
      const Vec2 off = frame(x) - p, u{frame.s.dot(by_u), frame.t.dot(by_u)}, v{frame.s.dot(by_v), frame.t.dot(by_v)};
      const double turn = line ? u[0] : cross(u, v);
      if (!(std::abs(turn) > 0)) break;
      const Vec2 change = line ? Vec2(off[0] / turn, 0) : Vec2(cross(off, v) / turn, cross(u, off) / turn);
      if (!(change.norm() < 1)) break;  // a face folded over itself: what there is must do
      at -= change;
      basis = shape_basis(kind, at);
      if (change.norm() < 1e-14) break;
    }
    return basis.value;
  }

  double distance(const FaceValues& shapes, const Vec3& from) const {
    Vec3 x = -from;
    for (std::size_t k = 0; k < points_.size(); ++k) x += shapes[k] * points_[k];
    return x.norm();
  }

  void begin(std::uint32_t face) {
    face_ = face;
    for (auto& row : sums_) row.fill(0);
  }
  void gather(const std::array<double, 3>& hats, std::size_t corners, const FaceValues& shapes, double weight) {
    for (std::size_t i = 0; i < corners; ++i)
      for (std::size_t k = 0; k < points_.size(); ++k) sums_[i][k] += weight * hats[i] * shapes[k];
  }
  /// ∫ N_i N_j dA of the piece's hat functions.
  void add_mass(const Piece& piece, double measure) {
    const auto corners = static_cast<double>(piece.count);
    const double off = measure / (corners * (corners + 1));
    for (std::size_t a = 0; a < piece.count; ++a)
      for (std::size_t b = 0; b < piece.count; ++b) {
        const auto &p = piece.corners[a], &q = piece.corners[b];
        const double value = (a == b ? 2 : 1) * off / static_cast<double>(p.count * q.count);
        for (std::size_t m = 0; m < p.count; ++m)
          for (std::size_t n = 0; n < q.count; ++n) hats_(static_cast<Eigen::Index>(p.nodes[m]), static_cast<Eigen::Index>(q.nodes[n])) += value;
      }
  }

  /// ∫ N_i N_k dA of a piece and a face of `to`, to the sums of the piece's face.
  void enter(const Piece& piece) {
    for (std::size_t k = 0; k < points_.size(); ++k) {
      const auto node = to_.nodes(face_)[k];
      auto found = static_cast<std::size_t>(std::find(under_.begin(), under_.end(), node) - under_.begin());
      if (found == under_.size()) {
        under_.push_back(node);
        shares_.emplace_back(FaceValues{});
      }
      for (std::size_t i = 0; i < piece.count; ++i) {
        const auto& corner = piece.corners[i];
        for (std::size_t n = 0; n < corner.count; ++n) shares_[found][corner.nodes[n]] += sums_[i][k] / static_cast<double>(corner.count);
      }
    }
  }

  /// A face of `from` is done: its hat functions become their duals where it is covered.
  void enter(std::span<const std::uint32_t> nodes) {
    const auto size = std::ssize(nodes);
    const FaceVector wholes = hats_.rowwise().sum();
    for (Eigen::Index i = 0; i < size; ++i) whole_[nodes[static_cast<std::size_t>(i)]] += wholes[i];
    double covered = 0;
    for (const auto& shares : shares_)
      for (const double share : shares) covered += share;
    const bool dual = std::abs(covered - wholes.sum()) <= almost_all * wholes.sum();
    // Of triangles and of lines all are alike, 4 δ − 1 and 3 δ − 1.
    if (dual && from_kind_ == FaceKind::triangle3) duals_ = 4 * Eigen::Matrix3d::Identity() - Eigen::Matrix3d::Ones();
    else if (dual && from_kind_ == FaceKind::quad4) duals_ = wholes.asDiagonal() * Eigen::Matrix4d(hats_).inverse();
    else if (dual) duals_ = wholes.asDiagonal() * hats_.inverse();
    const auto count = under_.size();
    if (count == 0) return;
    for (std::size_t i = 0; i < nodes.size(); ++i)
      parts_.push_back({nodes[i], static_cast<std::uint32_t>(count), part_nodes_.size(), part_values_.size() + i * count});
    part_nodes_.insert(part_nodes_.end(), under_.begin(), under_.end());
    for (Eigen::Index i = 0; i < size; ++i)
      for (const auto& of_node : shares_) {
        const Eigen::Map<const FaceVector> shares(of_node.data(), size);
        part_values_.push_back(dual ? duals_.row(i).dot(shares) : shares[i]);
      }
  }

  const SurfaceMesh &from_, &to_;
  const PartnerSearch& search_;
  double max_distance_;
  std::vector<bool> affine_;   // which faces of `to` are
  std::vector<double> whole_;  // ∫ N_i dA of each point [m], [m²]
  std::optional<std::uint32_t> nearest_;  // face of `to`, of the piece before
  std::vector<std::uint32_t> near_;
  std::vector<Vec3> points_;  // of the face of `to` under work
  FaceKind from_kind_ = FaceKind::line2;
  std::uint32_t face_ = 0;
  std::array<FaceValues, 3> sums_;  // of a piece and a face of `to`, by corner and node
  FaceMatrix hats_, duals_;         // of a face of `from`
  std::vector<std::uint32_t> under_;  // nodes of `to` that have a share of it, and the shares by its nodes
  std::vector<FaceValues> shares_;
  std::vector<Part, io::LargeMemory<Part>> parts_;
  std::vector<std::uint32_t, io::LargeMemory<std::uint32_t>> part_nodes_;
  std::vector<double, io::LargeMemory<double>> part_values_;
};

}  // namespace

Overlap overlap_of(const SurfaceMesh& from, const SurfaceMesh& to, const PartnerSearch& search, double max_distance) {
  return Integration(from, to, search, max_distance).rows();
}

}  // namespace acopla::coupler
