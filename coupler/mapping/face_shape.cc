#include "coupler/mapping/face_shape.h"

#include <Eigen/LU>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "geometry/triangle.h"

namespace acopla::coupler {
namespace {

using Triple = std::array<std::uint8_t, 3>;

/// A basis without derivatives, for where nobody asks for them.
struct Values {
  FaceValues value{};
};
template <class Basis>
constexpr bool derivatives = std::is_same_v<Basis, FaceBasis>;

/// The three quadratic polynomials of a line with nodes at −1, 1 and 0, and their derivatives.
struct Quadratic {
  explicit Quadratic(double t)
      : value{0.5 * t * (t - 1), 0.5 * t * (t + 1), (1 - t) * (1 + t)},
        first{t - 0.5, t + 0.5, -2 * t} {}
  std::array<double, 3> value, first;
  static constexpr std::array<double, 3> second{1, 1, -2};
};

/// Which of a line's nodes each node of a quad9 takes along ξ and along η.
constexpr std::array<std::array<std::size_t, 2>, 9> tensor_index{
    {{0, 0}, {1, 0}, {1, 1}, {0, 1}, {2, 0}, {1, 2}, {2, 1}, {0, 2}, {2, 2}}};

template <class Basis>
void line2_basis(double xi, Basis& basis) {
  basis.value = {0.5 * (1 - xi), 0.5 * (1 + xi)};
  if constexpr (derivatives<Basis>) basis.u = {-0.5, 0.5};
}

template <class Basis>
void line3_basis(double xi, Basis& basis) {
  const Quadratic line(xi);
  std::copy(line.value.begin(), line.value.end(), basis.value.begin());
  if constexpr (derivatives<Basis>) {
    std::copy(line.first.begin(), line.first.end(), basis.u.begin());
    std::copy(line.second.begin(), line.second.end(), basis.uu.begin());
  }
}

template <class Basis>
void triangle3_basis(double xi, double eta, Basis& basis) {
  basis.value = {1 - xi - eta, xi, eta};
  if constexpr (derivatives<Basis>) {
    basis.u = {-1, 1, 0};
    basis.v = {-1, 0, 1};
  }
}

template <class Basis>
void triangle6_basis(double xi, double eta, Basis& basis) {
  const std::array<double, 3> area{1 - xi - eta, xi, eta};
  constexpr std::array<double, 3> u{-1, 1, 0}, v{-1, 0, 1};
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t j = (i + 1) % 3;
    basis.value[i] = area[i] * (2 * area[i] - 1);
    basis.value[3 + i] = 4 * area[i] * area[j];
    if constexpr (derivatives<Basis>) {
      basis.u[i] = u[i] * (4 * area[i] - 1);
      basis.v[i] = v[i] * (4 * area[i] - 1);
      basis.uu[i] = 4 * u[i] * u[i];
      basis.uv[i] = 4 * u[i] * v[i];
      basis.vv[i] = 4 * v[i] * v[i];
      basis.u[3 + i] = 4 * (u[i] * area[j] + area[i] * u[j]);
      basis.v[3 + i] = 4 * (v[i] * area[j] + area[i] * v[j]);
      basis.uu[3 + i] = 8 * u[i] * u[j];
      basis.uv[3 + i] = 4 * (u[i] * v[j] + v[i] * u[j]);
      basis.vv[3 + i] = 8 * v[i] * v[j];
    }
  }
}

template <class Basis>
void quad4_basis(double xi, double eta, Basis& basis) {
  constexpr std::array<double, 4> a{-1, 1, 1, -1}, b{-1, -1, 1, 1};
  for (std::size_t k = 0; k < 4; ++k) {
    basis.value[k] = 0.25 * (1 + a[k] * xi) * (1 + b[k] * eta);
    if constexpr (derivatives<Basis>) {
      basis.u[k] = 0.25 * a[k] * (1 + b[k] * eta);
      basis.v[k] = 0.25 * (1 + a[k] * xi) * b[k];
      basis.uv[k] = 0.25 * a[k] * b[k];
    }
  }
}

template <class Basis>
void quad9_basis(double xi, double eta, Basis& basis) {
  const Quadratic p(xi), q(eta);
  for (std::size_t k = 0; k < 9; ++k) {
    const auto [i, j] = tensor_index[k];
    basis.value[k] = p.value[i] * q.value[j];
    if constexpr (derivatives<Basis>) {
      basis.u[k] = p.first[i] * q.value[j];
      basis.v[k] = p.value[i] * q.first[j];
      basis.uu[k] = p.second[i] * q.value[j];
      basis.uv[k] = p.first[i] * q.first[j];
      basis.vv[k] = p.value[i] * q.second[j];
    }
  }
}

template <class Basis>
void fill(FaceKind kind, const Vec2& parameters, Basis& basis) {
  const double xi = parameters[0], eta = parameters[1];
  switch (kind) {
    case FaceKind::line2:
      line2_basis(xi, basis);
      break;
    case FaceKind::line3:
      line3_basis(xi, basis);
      break;
    case FaceKind::triangle3:
      triangle3_basis(xi, eta, basis);
      break;
    case FaceKind::triangle6:
      triangle6_basis(xi, eta, basis);
      break;
    case FaceKind::quad4:
      quad4_basis(xi, eta, basis);
      break;
    case FaceKind::quad9:
      quad9_basis(xi, eta, basis);
      break;
  }
}

/// Corners of the parameter domain: two make a line, more a convex polygon.
std::span<const Vec2> domain_of(FaceKind kind) {
  return node_parameters(kind).first(geometry::corners_of(kind));
}

bool inside(FaceKind kind, const Vec2& p) {
  if (geometry::corners_of(kind) == 3) return p[0] >= 0 && p[1] >= 0 && p[0] + p[1] <= 1;
  return std::abs(p[0]) <= 1 && std::abs(p[1]) <= 1;
}

/// Triangles through all the nodes of a face, for the start of the search.
std::span<const Triple> triangles_of(FaceKind kind) {
  static constexpr std::array<Triple, 2> quad4{{{0, 1, 2}, {0, 2, 3}}};
  static constexpr std::array<Triple, 4> triangle6{{{0, 3, 5}, {3, 1, 4}, {5, 4, 2}, {3, 4, 5}}};
  static constexpr std::array<Triple, 8> quad9{
      {{0, 4, 8}, {0, 8, 7}, {4, 1, 5}, {4, 5, 8}, {8, 5, 2}, {8, 2, 6}, {7, 8, 6}, {7, 6, 3}}};
  switch (kind) {
    case FaceKind::quad4:
      return quad4;
    case FaceKind::triangle6:
      return triangle6;
    case FaceKind::quad9:
      return quad9;
    default:
      return {};
  }
}

/// Position of the nearest point of the segment (a, b), as a fraction from a to b.
double nearest_on_segment(const Vec3& x, const Vec3& a, const Vec3& b) {
  const Vec3 edge = b - a;
  const double square = edge.squaredNorm();
  return square > 0 ? std::clamp(edge.dot(x - a) / square, 0.0, 1.0) : 0.0;
}

/// Barycentric weights of the nearest point of a triangle, which may be degenerate.
std::array<double, 3> nearest_weights(const Vec3& x, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 ab = b - a, ac = c - a;
  constexpr double needle = 1e-28;  // (height / edge)² at which a height is nothing but round-off
  if (ab.cross(ac).squaredNorm() > needle * ab.squaredNorm() * ac.squaredNorm())
    return geometry::nearest_on_triangle(x, a, b, c).weights;
  const std::array<Vec3, 3> corners{a, b, c};
  std::array<double, 3> best{1, 0, 0};
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3 &p = corners[k], &q = corners[(k + 1) % 3];
    const double t = nearest_on_segment(x, p, q);
    const double square = (x - p - t * (q - p)).squaredNorm();
    if (square >= least) continue;
    least = square;
    best = {0, 0, 0};
    best[k] = 1 - t;
    best[(k + 1) % 3] = t;
  }
  return best;
}

Vec2 start_of(FaceKind kind, std::span<const Vec3> nodes, const Vec3& x) {
  const auto at = node_parameters(kind);
  if (kind == FaceKind::line3) {
    const double t0 = nearest_on_segment(x, nodes[0], nodes[2]),
                 t1 = nearest_on_segment(x, nodes[2], nodes[1]);
    const double s0 = (x - nodes[0] - t0 * (nodes[2] - nodes[0])).squaredNorm();
    const double s1 = (x - nodes[2] - t1 * (nodes[1] - nodes[2])).squaredNorm();
    return {s0 <= s1 ? t0 - 1 : t1, 0};
  }
  Vec2 best = at[0];
  double least = std::numeric_limits<double>::infinity();
  for (const auto& [a, b, c] : triangles_of(kind)) {
    const auto w = nearest_weights(x, nodes[a], nodes[b], nodes[c]);
    const double square = (x - w[0] * nodes[a] - w[1] * nodes[b] - w[2] * nodes[c]).squaredNorm();
    if (square >= least) continue;
    least = square;
    best = w[0] * at[a] + w[1] * at[b] + w[2] * at[c];
  }
  return best;
}

/// ½|x − X|² and its quadratic model at a point of the face.
struct Model {
  double value;
  Vec2 gradient;
  Eigen::Matrix2d newton, gauss;
};

double half_square(FaceKind kind, std::span<const Vec3> nodes, const Vec3& x, const Vec2& p) {
  const auto weights = shape_functions(kind, p);
  Vec3 point = Vec3::Zero();
  for (std::size_t k = 0; k < nodes.size(); ++k) point += weights[k] * nodes[k];
  return 0.5 * (x - point).squaredNorm();
}

Model model_at(FaceKind kind, std::span<const Vec3> nodes, const Vec3& x, const Vec2& p) {
  const auto basis = shape_basis(kind, p);
  Vec3 r = x, u = Vec3::Zero(), v = Vec3::Zero(), uu = Vec3::Zero(), uv = Vec3::Zero(),
       vv = Vec3::Zero();
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    r -= basis.value[k] * nodes[k];
    u += basis.u[k] * nodes[k];
    v += basis.v[k] * nodes[k];
    uu += basis.uu[k] * nodes[k];
    uv += basis.uv[k] * nodes[k];
    vv += basis.vv[k] * nodes[k];
  }
  Model model;
  model.value = 0.5 * r.squaredNorm();
  model.gradient << -r.dot(u), -r.dot(v);
  model.gauss << u.dot(u), u.dot(v), u.dot(v), v.dot(v);
  Eigen::Matrix2d curvature;
  curvature << r.dot(uu), r.dot(uv), r.dot(uv), r.dot(vv);
  model.newton = model.gauss - curvature;
  return model;
}

/// Convex with some margin, compared with the metric of the face.
bool convex(FaceKind kind, const Eigen::Matrix2d& hessian, const Eigen::Matrix2d& gauss) {
  constexpr double margin = 1e-8;
  if (geometry::corners_of(kind) == 2) return hessian(0, 0) > margin * gauss(0, 0);
  return hessian(0, 0) > margin * gauss(0, 0) && hessian(1, 1) > margin * gauss(1, 1) &&
         hessian.determinant() > margin * gauss(0, 0) * gauss(1, 1);
}

/// Minimum of g·d + ½ dᵀ H d with p + d in the parameter domain, H positive definite. By convexity
/// it is the free minimum or lies on the boundary, where each edge is a problem of one variable.
Vec2 minimise(FaceKind kind, const Vec2& p, const Vec2& g, const Eigen::Matrix2d& hessian) {
  const auto corners = domain_of(kind);
  if (corners.size() > 2) {
    const Vec2 free = p - hessian.inverse() * g;
    if (inside(kind, free)) return free;
  }
  Vec2 best = p;
  double least = std::numeric_limits<double>::infinity();
  const std::size_t edges = corners.size() > 2 ? corners.size() : 1;
  for (std::size_t k = 0; k < edges; ++k) {
    const Vec2& from = corners[k];
    const Vec2 along = corners[(k + 1) % corners.size()] - from, d = from - p;
    const double stiffness = along.dot(hessian * along);
    const double t =
        stiffness > 0 ? std::clamp(-along.dot(g + hessian * d) / stiffness, 0.0, 1.0) : 0.0;
    const Vec2 step = d + t * along;
    const double value = g.dot(step) + 0.5 * step.dot(hessian * step);
    if (value >= least) continue;
    least = value;
    best = from + t * along;
  }
  return best;
}

struct Minimum {
  Vec2 parameters;
  double value;
  int iterations;
  bool converged;
};

Minimum newton_from(FaceKind kind, std::span<const Vec3> nodes, const Vec3& x, const Vec2& start) {
  // Below `unresolved` the change of the squared distance drowns in round-off, though Newton's step
  // is still good.
  constexpr int limit = 60;
  constexpr double done = 1e-11, unresolved = 1e-6;
  Vec2 p = start;
  Model model = model_at(kind, nodes, x, p);
  double damping = 0;
  int unjudged = 0;
  for (int iteration = 1; iteration <= limit; ++iteration) {
    const bool newton = damping == 0 && convex(kind, model.newton, model.gauss);
    Eigen::Matrix2d hessian = newton ? model.newton : model.gauss;
    const double scale = model.gauss.trace();
    if (!(scale > 0)) return {p, model.value, iteration, false};  // all nodes in one place
    if (!newton) hessian.diagonal().array() += std::max(damping, 1e-12) * scale;
    const Vec2 next = minimise(kind, p, model.gradient, hessian);
    const double step = (next - p).lpNorm<Eigen::Infinity>();
    const double value = half_square(kind, nodes, x, next);
    const bool small = newton && step <= unresolved;
    if (value < model.value || small) {
      p = next;
      if (step <= done || (small && ++unjudged >= 3)) return {p, value, iteration, true};
      model = model_at(kind, nodes, x, p);
      damping = damping > 1e-3 ? damping / 8 : 0;
    } else if (step <= 1e-8) {  // no descent left that the arithmetic can see
      return {p, model.value, iteration, true};
    } else {
      damping = std::max(1e-3, 8 * damping);
    }
  }
  return {p, model.value, limit, false};
}

/// To round-off; its two triangles then are the face itself, parameters and all.
bool is_parallelogram(std::span<const Vec3> nodes) {
  constexpr double round_off = 1e-14;
  const Vec3 u = nodes[1] - nodes[0], v = nodes[3] - nodes[0];
  return (nodes[2] - nodes[0] - u - v).squaredNorm() <= round_off * round_off * (u.squaredNorm() + v.squaredNorm());
}

FaceProjection finish(FaceKind kind, std::span<const Vec3> nodes, const Vec3& x,
                      const FaceValues& weights, const Vec2& parameters) {
  FaceProjection result;
  result.weights = weights;
  result.parameters = parameters;
  result.point = Vec3::Zero();
  for (std::size_t k = 0; k < geometry::nodes_of(kind); ++k) result.point += weights[k] * nodes[k];
  result.distance = (x - result.point).norm();
  return result;
}

}  // namespace

FaceBasis shape_basis(FaceKind kind, const Vec2& parameters) {
  FaceBasis basis;
  fill(kind, parameters, basis);
  return basis;
}

FaceValues shape_functions(FaceKind kind, const Vec2& parameters) {
  Values basis;
  fill(kind, parameters, basis);
  return basis.value;
}

std::span<const Vec2> node_parameters(FaceKind kind) {
  static const std::array<Vec2, 3> line{Vec2(-1, 0), Vec2(1, 0), Vec2(0, 0)};
  static const std::array<Vec2, 6> triangle{Vec2(0, 0),   Vec2(1, 0),     Vec2(0, 1),
                                            Vec2(0.5, 0), Vec2(0.5, 0.5), Vec2(0, 0.5)};
  static const std::array<Vec2, 9> quad{Vec2(-1, -1), Vec2(1, -1), Vec2(1, 1),
                                        Vec2(-1, 1),  Vec2(0, -1), Vec2(1, 0),
                                        Vec2(0, 1),   Vec2(-1, 0), Vec2(0, 0)};
  const std::size_t count = geometry::nodes_of(kind);
  switch (geometry::corners_of(kind)) {
    case 2:
      return std::span(line).first(count);
    case 3:
      return std::span(triangle).first(count);
    case 4:
      return std::span(quad).first(count);
    default:
      return {};
  }
}

geometry::Box box_of_face(FaceKind kind, std::span<const Vec3> nodes) {
  assert(nodes.size() == geometry::nodes_of(kind) && !nodes.empty());
  std::array<Vec3, max_face_nodes> points;
  std::copy(nodes.begin(), nodes.end(), points.begin());
  // A quadratic through a, m, b has the Bézier points a, 2m − (a + b)/2, b.
  const auto bulge = [&](std::size_t a, std::size_t b, std::size_t middle) {
    points[middle] = 2 * points[middle] - 0.5 * (points[a] + points[b]);
  };
  if (kind == FaceKind::line3) {
    bulge(0, 1, 2);
  } else if (kind == FaceKind::triangle6) {
    for (std::size_t k = 0; k < 3; ++k) bulge(k, (k + 1) % 3, 3 + k);
  } else if (kind == FaceKind::quad9) {  // along ξ, then along η
    bulge(0, 1, 4);
    bulge(3, 2, 6);
    bulge(7, 5, 8);
    bulge(0, 3, 7);
    bulge(1, 2, 5);
    bulge(4, 6, 8);
  }
  geometry::Box box{points[0], points[0]};
  for (std::size_t k = 1; k < nodes.size(); ++k) {
    box.low = box.low.cwiseMin(points[k]);
    box.high = box.high.cwiseMax(points[k]);
  }
  return box;
}

FaceProjection project_on_face(FaceKind kind, std::span<const Vec3> nodes, const Vec3& x) {
  assert(nodes.size() == geometry::nodes_of(kind));
  if (kind == FaceKind::line2) {
    const double t = nearest_on_segment(x, nodes[0], nodes[1]);
    return finish(kind, nodes, x, {1 - t, t}, {2 * t - 1, 0});
  }
  if (kind == FaceKind::triangle3) {
    const auto w = nearest_weights(x, nodes[0], nodes[1], nodes[2]);
    return finish(kind, nodes, x, {w[0], w[1], w[2]}, {w[1], w[2]});
  }
  const Vec2 start = start_of(kind, nodes, x);
  if (kind == FaceKind::quad4 && is_parallelogram(nodes)) return finish(kind, nodes, x, shape_functions(kind, start), start);
  auto best = newton_from(kind, nodes, x, start);
  if (!best.converged) {  // a badly folded face: try every node of it and keep what lies nearest
    for (const auto& node : node_parameters(kind)) {
      const auto other = newton_from(kind, nodes, x, node);
      if (other.value < best.value) best = other;
    }
  }
  auto result = finish(kind, nodes, x, shape_functions(kind, best.parameters), best.parameters);
  result.iterations = best.iterations;
  result.converged = best.converged;
  return result;
}

}  // namespace acopla::coupler
