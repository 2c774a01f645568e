#include "dem/wall/wall_set.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <map>
#include <stdexcept>

#include "geometry/segment.h"
#include "geometry/triangle.h"

namespace acopla::dem {
namespace {

double from_axis(const Motion& motion, const Vec3& point) {
  const Vec3 arm = point - motion.centre();
  return (arm - arm.dot(motion.axis()) * motion.axis()).norm();
}

// The third vertex of a segment leaves no mark.
constexpr std::array<double, 3> at_corner(std::size_t k) { return {k == 0 ? 1.0 : 0.0, k == 1 ? 1.0 : 0.0, k == 2 ? 1.0 : 0.0}; }

}  // namespace

WallSet::WallSet(std::vector<Wall> walls) : walls_(std::move(walls)) {
  const auto count = walls_.size();
  for (std::uint32_t w = 0; w < count; ++w) {
    const auto& wall = walls_[w];
    const auto first = static_cast<std::uint32_t>(vertices_.size());
    first_vertex_.push_back(first);
    first_facet_.push_back(static_cast<std::uint32_t>(facets_.size()));
    if (wall.is_plane) continue;
    vertices_.insert(vertices_.end(), wall.mesh.points.begin(), wall.mesh.points.end());
    for (const auto& corners : wall.mesh.triangles) add_facet(w, {first + corners[0], first + corners[1], first + corners[2]});
    vertices_.insert(vertices_.end(), wall.line.begin(), wall.line.end());
    const auto corners = static_cast<std::uint32_t>(wall.line.size());
    for (std::uint32_t k = 0; k + 1 < corners; ++k) add_facet(w, {first + k, first + k + 1, none});
    if (wall.closed) add_facet(w, {first + corners - 1, first, none});
    vertex_wall_.resize(vertices_.size(), w);
  }
  first_vertex_.push_back(static_cast<std::uint32_t>(vertices_.size()));
  first_facet_.push_back(static_cast<std::uint32_t>(facets_.size()));
  plane_of_.assign(count, none);
  for (std::uint32_t w = 0; w < count; ++w)
    if (walls_[w].is_plane) {
      plane_of_[w] = static_cast<std::uint32_t>(planes_.size());
      planes_.push_back({walls_[w].point, walls_[w].normal, w});
      element_wall_.push_back(w);
    }
  for (std::uint32_t w = 0; w < count; ++w) {
    first_ball_.push_back(static_cast<std::uint32_t>(balls_.size()));
    if (walls_[w].glued_diameter > 0) glue(w);
  }
  first_ball_.push_back(static_cast<std::uint32_t>(balls_.size()));

  frames_.resize(count);
  placements_.resize(count);
  marks_.resize(count);
  servos_.resize(count);
  prescribed_.resize(count);
  grids_.resize(count);
  middle_.resize(count);
  extent_.assign(count, 0);
  sends_.assign(count, 0);
  sent_vertex_.assign(count, 0);
  sent_facet_.assign(count, 0);
  for (std::size_t w = 0; w < count; ++w) {
    const auto& motion = walls_[w].motion;
    const auto first = vertices_.begin() + first_vertex_[w], last = vertices_.begin() + first_vertex_[w + 1];
    if (motion.kind() == Motion::Kind::prescribed) {
      frames_[w].deforms = true;
      auto& prescribed = prescribed_[w];
      prescribed.position.assign(first, last);
      prescribed.velocity.assign(prescribed.position.size(), Vec3::Zero());
      prescribed.marked = prescribed.position;
    }
    for (auto v = first; v != last; ++v) extent_[w] = std::max(extent_[w], from_axis(motion, *v) + 0.5 * walls_[w].glued_diameter);
    find_middle(w);
    frames_[w].reference = middle_[w];
    if (motion.moves()) {
      movers_.push_back(static_cast<std::uint32_t>(w));
      has_servos_ = has_servos_ || motion.kind() == Motion::Kind::servo;
      place(w, motion.at(0));
    }
    build_grid(w);
  }
}

void WallSet::add_facet(std::uint32_t wall, const std::array<std::uint32_t, 3>& vertices) {
  Facet facet;
  facet.vertices = vertices;
  facet.wall = wall;
  const Vec3 &a = vertices_[vertices[0]], &b = vertices_[vertices[1]];
  facet.gradient.fill(Vec3::Zero());
  if (vertices[2] == none) {
    const Vec3 along = b - a;
    facet.normal = Vec3(-along[1], along[0], 0).normalized();
    facet.centre = 0.5 * (a + b);
    facet.gradient[1] = along / along.squaredNorm();
    facet.gradient[0] = -facet.gradient[1];
    facet.radius = 0.5 * along.norm();
  } else {
    const Vec3& c = vertices_[vertices[2]];
    const Vec3 area = (b - a).cross(c - a);
    facet.normal = area.normalized();
    facet.centre = (a + b + c) / 3;
    const std::array<Vec3, 3> corner{a, b, c};
    double square = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      facet.gradient[k] = facet.normal.cross(corner[(k + 2) % 3] - corner[(k + 1) % 3]) / area.norm();
      square = std::max(square, (corner[k] - facet.centre).squaredNorm());
    }
    facet.radius = std::sqrt(square);
  }
  for (std::size_t k = 0; k < 3; ++k) facet.square_height[k] = 1 / facet.gradient[k].squaredNorm();
  facets_.push_back(facet);
  element_wall_.push_back(wall);
}

void WallSet::add_ball(std::uint32_t wall, std::uint32_t facet, const std::array<double, 3>& weights) {
  Ball ball{facet, weights, Vec3::Zero(), 0.5 * walls_[wall].glued_diameter};
  for (std::size_t k = 0; k < vertices_of(facet); ++k) ball.centre += weights[k] * vertices_[facets_[facet].vertices[k]];
  balls_.push_back(ball);
  element_wall_.push_back(wall);
}

// Every vertex is the centre of a ball, and between two vertices there are as many as keep the spacing (Gomes 2014, §2.3.3); inside
// triangles they stand on the lattice of barycentric coordinates that the longest edge has room for.
void WallSet::glue(std::uint32_t wall) {
  const double spacing = walls_[wall].glued_spacing > 0 ? walls_[wall].glued_spacing : walls_[wall].glued_diameter;
  const auto divisions = [&](double length) { return std::max(1, static_cast<int>(std::floor(length / spacing * (1 + 1e-9)))); };
  std::vector<bool> has_ball(first_vertex_[wall + 1] - first_vertex_[wall], false);
  std::map<std::pair<std::uint32_t, std::uint32_t>, bool> edges;
  for (auto f = first_facet_[wall]; f < first_facet_[wall + 1]; ++f) {
    const auto& vertices = facets_[f].vertices;
    const std::size_t size = vertices_of(f);
    int most = 1;
    for (std::size_t k = 0; k < size; ++k) {
      const auto own = vertices[k] - first_vertex_[wall];
      if (!has_ball[own]) add_ball(wall, f, at_corner(k));
      has_ball[own] = true;
      if (size == 2 && k == 1) break;
      const auto next = (k + 1) % size;
      const int n = divisions((vertices_[vertices[next]] - vertices_[vertices[k]]).norm());
      most = std::max(most, n);
      auto& done = edges[std::minmax(vertices[k], vertices[next])];
      for (int i = 1; i < n && !done; ++i) {
        std::array<double, 3> weights{};
        weights[next] = static_cast<double>(i) / n;
        weights[k] = 1 - weights[next];
        add_ball(wall, f, weights);
      }
      done = true;
    }
    if (size == 3)
      for (int i = 1; i < most; ++i)
        for (int j = 1; i + j < most; ++j) {
          const double u = static_cast<double>(i) / most, v = static_cast<double>(j) / most;
          add_ball(wall, f, {1 - u - v, u, v});
        }
  }
}

void WallSet::find_middle(std::size_t wall) {
  const auto first = first_vertex_[wall], last = first_vertex_[wall + 1];
  middle_[wall] = walls_[wall].point;
  if (first == last) return;
  middle_[wall].setZero();
  for (auto v = first; v < last; ++v) middle_[wall] += vertices_[v] / (last - first);
}

void WallSet::build_grid(std::size_t wall) {
  grids_[wall].reset();
  if (walls_[wall].is_plane) return;
  std::vector<geometry::Box> boxes;
  const bool deforming = deforms(wall);
  const auto at = [&](std::uint32_t vertex) -> const Vec3& {
    return deforming ? prescribed_[wall].marked[vertex - first_vertex_[wall]] : vertices_[vertex];
  };
  if (walls_[wall].glued_diameter > 0) {
    for (auto b = first_ball_[wall]; b < first_ball_[wall + 1]; ++b) {
      const auto& ball = balls_[b];
      Vec3 centre = ball.centre;
      if (deforming) {
        centre.setZero();
        for (std::size_t k = 0; k < vertices_of(ball.facet); ++k) centre += ball.weights[k] * at(facets_[ball.facet].vertices[k]);
      }
      boxes.push_back({centre - Vec3::Constant(ball.radius), centre + Vec3::Constant(ball.radius)});
    }
  } else {
    for (auto f = first_facet_[wall]; f < first_facet_[wall + 1]; ++f) {
      const auto& vertices = facets_[f].vertices;
      geometry::Box box{at(vertices[0]), at(vertices[0])};
      for (std::size_t k = 1; k < vertices_of(f); ++k) {
        box.low = box.low.cwiseMin(at(vertices[k]));
        box.high = box.high.cwiseMax(at(vertices[k]));
      }
      boxes.push_back(box);
    }
  }
  if (!boxes.empty()) grids_[wall].emplace(boxes);
}

std::uint32_t WallSet::carrier(std::uint32_t element) const {
  if (is_facet(element)) return element;
  return is_ball(element) ? balls_[ball_index(element)].facet : none;
}

Vec3 WallSet::body_vertex(std::uint32_t vertex) const {
  const auto wall = vertex_wall_[vertex];
  if (!deforms(wall)) return vertices_[vertex];
  const auto& prescribed = prescribed_[wall];
  const auto own = vertex - first_vertex_[wall];
  return prescribed.position[own] + (time_ - prescribed.start) * prescribed.velocity[own];
}

Vec3 WallSet::vertex(std::uint32_t vertex) const { return to_world(vertex_wall_[vertex], body_vertex(vertex)); }

std::vector<Vec3> WallSet::positions(std::size_t wall) const {
  std::vector<Vec3> positions;
  for (auto v = first_vertex_[wall]; v < first_vertex_[wall + 1]; ++v) positions.push_back(vertex(v));
  return positions;
}

WallSet::BallNow WallSet::ball(std::uint32_t element) const {
  const auto& ball = balls_[ball_index(element)];
  const auto wall = element_wall_[element];
  if (!deforms(wall)) return {to_world(wall, ball.centre), ball.radius};
  Vec3 centre = Vec3::Zero();
  for (std::size_t k = 0; k < vertices_of(ball.facet); ++k) centre += ball.weights[k] * body_vertex(facets_[ball.facet].vertices[k]);
  return {centre, ball.radius};
}

std::vector<Record> WallSet::glued_particles(std::size_t wall) const {
  std::vector<Record> particles;
  const auto first = static_cast<std::uint32_t>(facets_.size() + planes_.size());
  for (auto b = first_ball_[wall]; b < first_ball_[wall + 1]; ++b) {
    const auto now = ball(first + b);
    particles.push_back({now.centre[0], now.centre[1], now.centre[2], now.radius});
  }
  return particles;
}

geometry::SurfaceMesh WallSet::surface(std::size_t wall) const {
  if (walls_[wall].is_plane) throw std::logic_error("a plane has no surface mesh");
  geometry::SurfaceMesh surface;
  const auto first = first_vertex_[wall];
  surface.points.assign(vertices_.begin() + first, vertices_.begin() + first_vertex_[wall + 1]);
  for (auto f = first_facet_[wall]; f < first_facet_[wall + 1]; ++f) {
    std::array<std::uint32_t, 3> nodes{};
    const auto size = vertices_of(f);
    for (std::size_t k = 0; k < size; ++k) nodes[k] = facets_[f].vertices[k] - first;
    surface.add_face(size == 2 ? geometry::FaceKind::line2 : geometry::FaceKind::triangle3, {nodes.data(), size});
  }
  return surface;
}

std::optional<geometry::Box> WallSet::bounds() const {
  std::optional<geometry::Box> box;
  for (std::uint32_t v = 0; v < vertices_.size(); ++v) {
    const Vec3 at = vertex(v), margin = Vec3::Constant(0.5 * walls_[vertex_wall_[v]].glued_diameter);
    if (!box) box = {at - margin, at + margin};
    box->low = box->low.cwiseMin(at - margin);
    box->high = box->high.cwiseMax(at + margin);
  }
  return box;
}

void WallSet::find_near(const Vec3& centre, double reach, std::vector<std::uint32_t>& found) const {
  const auto first_ball = static_cast<std::uint32_t>(facets_.size() + planes_.size());
  for (std::size_t w = 0; w < walls_.size(); ++w) {
    if (!grids_[w]) continue;
    const bool glued = walls_[w].glued_diameter > 0;
    const auto first_item = glued ? first_ball + first_ball_[w] : first_facet_[w];
    const auto begin = static_cast<std::ptrdiff_t>(found.size());
    const Vec3 body = to_body(w, centre), half = Vec3::Constant(reach);
    grids_[w]->for_each_near(body - half, body + half, [&](std::uint32_t item) { found.push_back(first_item + item); });
    std::sort(found.begin() + begin, found.end());
    found.erase(std::unique(found.begin() + begin, found.end()), found.end());
    const auto is_far = [&](std::uint32_t element) {
      NearestPoint nearest;
      return glued ? !touches(element, centre, reach, nearest) : !touches_facet(facets_[element], body, reach, nearest);
    };
    found.erase(std::remove_if(found.begin() + begin, found.end(), is_far), found.end());
  }
  for (std::size_t k = 0; k < planes_.size(); ++k)
    if ((centre - planes_[k].point).dot(planes_[k].normal) < reach) found.push_back(static_cast<std::uint32_t>(facets_.size() + k));
  if (!balls_.empty() && !planes_.empty()) std::sort(found.begin(), found.end());
}

bool WallSet::touches(std::uint32_t element, const Vec3& centre, double radius, NearestPoint& nearest) const {
  nearest.element = element;
  if (is_plane(element)) {
    const auto& plane = planes_[element - facets_.size()];
    const double height = (centre - plane.point).dot(plane.normal);
    if (height >= radius) return false;
    nearest.distance = height;
    nearest.normal = plane.normal;
    nearest.point = centre - height * plane.normal;
    nearest.weights = {};
    nearest.feature_size = 0;
    return true;
  }
  if (is_ball(element)) {
    const auto now = ball(element);
    const Vec3 line = centre - now.centre;
    const double bound = radius + now.radius;
    if (line.squaredNorm() >= bound * bound) return false;
    const double distance = line.norm();
    nearest.distance = distance - now.radius;
    nearest.normal = distance > 0 ? Vec3(line / distance) : Vec3(Vec3::UnitX());
    nearest.point = now.centre + now.radius * nearest.normal;
    nearest.weights = ball_weights(element);
    nearest.feature_size = 0;
    return true;
  }
  const auto& facet = facets_[element];
  const auto& frame = frames_[facet.wall];
  if (!frame.moves) return touches_facet(facet, centre, radius, nearest);
  if (!touches_facet(facet, to_body(facet.wall, centre), radius, nearest)) return false;
  if (frame.turns) nearest.normal = frame.rotation * nearest.normal;
  nearest.point = to_world(facet.wall, nearest.point);
  return true;
}

bool WallSet::touches_facet(const Facet& facet, const Vec3& body, double radius, NearestPoint& nearest) const {
  if (!frames_[facet.wall].deforms) {
    const Vec3 from_centre = body - facet.centre;
    // In the facet's plane the sphere is a circle; (a + b)² ≤ 2 a² + 2 b² spares the root.
    const double height = from_centre.dot(facet.normal), left = radius * radius - height * height;
    if (left <= 0 || from_centre.squaredNorm() - height * height >= 2 * (1 + 1e-12) * (left + facet.radius * facet.radius)) return false;
    const bool segment = facet.vertices[2] == none;
    const double mean = segment ? 0.5 : 1.0 / 3.0;
    std::array<double, 3> weights{};
    bool inside = true;
    for (std::size_t k = 0; k < (segment ? 2 : 3); ++k) {
      weights[k] = mean + facet.gradient[k].dot(from_centre);
      if (weights[k] > 0) continue;
      inside = false;
      if (weights[k] * weights[k] * facet.square_height[k] > left * (1 + 1e-12)) return false;  // so far beyond that edge
    }
    if (inside) {
      // By the facet's own normal: the response of a split plane is the plane's to round-off.
      nearest.distance = std::abs(height);
      nearest.normal = height < 0 ? Vec3(-facet.normal) : facet.normal;
      nearest.point = body - height * facet.normal;
      nearest.weights = weights;
      nearest.feature_size = 0;
      return true;
    }
  }
  find_nearest(facet, body, nearest);
  return nearest.distance < radius;
}

void WallSet::find_nearest(const Facet& facet, const Vec3& body, NearestPoint& nearest) const {
  const bool deforming = frames_[facet.wall].deforms;
  const auto size = facet.vertices[2] == none ? 2u : 3u;
  std::array<Vec3, 3> corner;
  if (deforming) {
    const auto& prescribed = prescribed_[facet.wall];
    const auto first = first_vertex_[facet.wall];
    for (std::size_t k = 0; k < size; ++k)
      corner[k] = prescribed.position[facet.vertices[k] - first] + (time_ - prescribed.start) * prescribed.velocity[facet.vertices[k] - first];
  } else {
    for (std::size_t k = 0; k < size; ++k) corner[k] = vertices_[facet.vertices[k]];
  }
  double squared = 0;
  if (size == 2) {
    const auto found = geometry::nearest_on_segment(body, corner[0], corner[1]);
    squared = found.squared_distance;
    nearest.weights = {found.weights[0], found.weights[1], 0};
    nearest.point = found.point;
    nearest.feature_size = found.feature == geometry::SegmentFeature::inside ? 0 : 1;
    nearest.feature[0] = facet.vertices[found.feature == geometry::SegmentFeature::vertex1];
  } else {
    const auto found = geometry::nearest_on_triangle(body, corner[0], corner[1], corner[2]);
    squared = found.squared_distance;
    nearest.weights = found.weights;
    nearest.point = found.point;
    const auto kind = static_cast<int>(found.feature);
    const bool edge = kind <= static_cast<int>(geometry::TriangleFeature::edge2);
    nearest.feature_size = kind == 0 ? 0 : edge ? 2 : 1;
    if (kind > 0) {
      const auto first = static_cast<std::size_t>(edge ? kind - 1 : kind - 4);
      nearest.feature[0] = facet.vertices[first];
      nearest.feature[1] = facet.vertices[(first + 1) % 3];
    }
  }
  const auto normal = [&]() -> Vec3 {
    if (!deforming) return facet.normal;
    if (size == 2) return Vec3(corner[0][1] - corner[1][1], corner[1][0] - corner[0][0], 0).normalized();
    return (corner[1] - corner[0]).cross(corner[2] - corner[0]).normalized();
  };
  if (nearest.feature_size == 0) {
    nearest.normal = normal();
    const double height = nearest.normal.dot(body - (deforming ? corner[0] : facet.centre));
    nearest.distance = std::abs(height);
    if (height < 0) nearest.normal = -nearest.normal;
  } else {
    nearest.distance = std::sqrt(squared);
    nearest.normal = nearest.distance > 0 ? Vec3((body - nearest.point) / nearest.distance) : normal();
  }
}

Record WallSet::flat(std::uint32_t element) const {
  Record flat;
  if (is_plane(element)) {
    const auto& wall = walls_[element_wall_[element]];
    flat.set(wall.normal);
    flat.w = wall.normal.dot(wall.point);
  } else {
    const auto& facet = facets_[element];
    flat.set(facet.normal);
    flat.w = facet.normal.dot(facet.centre);
  }
  return flat;
}

Record WallSet::to_world(std::size_t wall, const Record& flat) const {
  const auto& frame = frames_[wall];
  const Vec3 normal = frame.turns ? Vec3(frame.rotation * flat.vector()) : flat.vector();
  return {normal[0], normal[1], normal[2], flat.w + normal.dot(frame.shift)};
}

std::array<double, 3> WallSet::foot_weights(std::uint32_t element, const Vec3& body) const {
  const auto& facet = facets_[element];
  const Vec3 from_centre = body - facet.centre;
  const bool segment = facet.vertices[2] == none;
  const double mean = segment ? 0.5 : 1.0 / 3.0;
  return {mean + facet.gradient[0].dot(from_centre), mean + facet.gradient[1].dot(from_centre),
          segment ? 0 : mean + facet.gradient[2].dot(from_centre)};
}

bool WallSet::holds_foot(std::uint32_t element, const Vec3& centre, double travel) const {
  const auto& facet = facets_[element];
  if (deforms(facet.wall)) return false;
  const auto weights = foot_weights(element, to_body(facet.wall, centre));
  // A weight falls to zero over the height of its vertex, one over the gradient.
  for (std::size_t k = 0; k < vertices_of(element); ++k)
    if (!(weights[k] > travel * facet.gradient[k].norm())) return false;
  return true;
}

bool WallSet::yields_to(std::uint32_t element, std::uint32_t other, const Vec3& centre, double travel) const {
  const auto &facet = facets_[element], &holder = facets_[other];
  if (facet.wall != holder.wall || deforms(facet.wall)) return false;
  const Vec3 body = to_body(facet.wall, centre);
  NearestPoint nearest;
  find_nearest(facet, body, nearest);
  if (nearest.feature_size == 0) return false;
  for (std::size_t k = 0; k < nearest.feature_size; ++k)
    if (std::find(holder.vertices.begin(), holder.vertices.end(), nearest.feature[k]) == holder.vertices.end()) return false;
  const std::size_t size = vertices_of(element);
  if (nearest.feature_size == 2) {
    // The nearest point of a convex set moves no farther than the centre does: it stays on the edge while it is away from the edge's
    // ends, and while the centre does not come over the facet.
    const Vec3 &a = vertices_[nearest.feature[0]], &b = vertices_[nearest.feature[1]];
    if (!((nearest.point - a).norm() > travel && (nearest.point - b).norm() > travel)) return false;
    const auto weights = foot_weights(element, body);
    for (std::size_t k = 0; k < size; ++k)
      if (facet.vertices[k] != nearest.feature[0] && facet.vertices[k] != nearest.feature[1])
        return -weights[k] > travel * facet.gradient[k].norm();
    return false;
  }
  // It stays at the vertex while the centre is behind both edges that begin there.
  const Vec3& corner = vertices_[nearest.feature[0]];
  for (std::size_t k = 0; k < size; ++k) {
    if (facet.vertices[k] == nearest.feature[0]) continue;
    if (!(-(vertices_[facet.vertices[k]] - corner).normalized().dot(body - corner) > travel)) return false;
  }
  return true;
}

bool WallSet::turn_at_all(std::uint8_t material) const {
  for (std::size_t w = 0; w < walls_.size(); ++w)
    if (walls_[w].material == material && (walls_[w].motion.turns() || deforms(w))) return true;
  return false;
}

void WallSet::place(std::size_t wall, const Placement& placement) {
  placements_[wall] = placement;
  const auto& motion = walls_[wall].motion;
  auto& frame = frames_[wall];
  if (motion.kind() == Motion::Kind::prescribed) return;
  frame.moves = true;
  frame.velocity = placement.velocity;
  if (motion.turns()) {
    frame.turns = true;
    frame.rotation = Eigen::AngleAxisd(placement.angle, motion.axis()).toRotationMatrix();
    frame.spin = placement.rate * motion.axis();
    frame.reference = motion.centre() + placement.displacement;
    frame.shift = frame.reference - frame.rotation * motion.centre();
  } else {
    frame.shift = placement.displacement;
    frame.reference = middle_[wall] + placement.displacement;
  }
  if (walls_[wall].is_plane) {
    auto& plane = planes_[plane_of_[wall]];
    plane.point = to_world(wall, walls_[wall].point);
    plane.normal = frame.turns ? Vec3(frame.rotation * walls_[wall].normal) : walls_[wall].normal;
  }
}

void WallSet::move(double time, double step) {
  time_ = time;
  for (const auto w : movers_) {
    const auto& motion = walls_[w].motion;
    if (motion.kind() == Motion::Kind::prescribed) {
      if (!prescribed_[w].curve.empty()) follow_curve(prescribed_[w]);
      continue;
    }
    if (motion.kind() != Motion::Kind::servo) {
      place(w, motion.at(time));
      continue;
    }
    const auto& servo = motion.servo();
    auto& state = servos_[w];
    state.speed = time <= servo.start ? 0 : servo.gain > 0 ? servo.gain * (servo.force + state.force)
                                                           : (servo.mass * state.speed + step * (servo.force + state.force)) /
                                                                 (servo.mass + servo.damping * step);
    state.speed = std::clamp(state.speed, -servo.max_speed, servo.max_speed);
    state.travel += state.speed * step;
    Placement placement;
    placement.displacement = state.travel * servo.direction;
    placement.velocity = state.speed * servo.direction;
    place(w, placement);
  }
}

Vec3 WallSet::velocity_at(const NearestPoint& contact) const {
  const auto wall = element_wall_[contact.element];
  if (!deforms(wall)) return frames_[wall].moves ? rigid_velocity(wall, contact.point) : Vec3(Vec3::Zero());
  const auto& prescribed = prescribed_[wall];
  const auto& facet = facets_[carrier(contact.element)];
  Vec3 velocity = Vec3::Zero();
  for (std::size_t k = 0; k < 3 && facet.vertices[k] != none; ++k)
    velocity += contact.weights[k] * prescribed.velocity[facet.vertices[k] - first_vertex_[wall]];
  if (is_ball(contact.element)) velocity += spin_of(contact.element).cross(balls_[ball_index(contact.element)].radius * contact.normal);
  return velocity;
}

Vec3 WallSet::spin_of(std::uint32_t element) const {
  const auto wall = element_wall_[element];
  if (!deforms(wall)) return frames_[wall].spin;
  const auto& facet = facets_[carrier(element)];
  const auto first = first_vertex_[wall];
  const auto& velocities = prescribed_[wall].velocity;
  // ω = J⁻¹ Σ d × v, J = Σ (|d|² I − d dᵀ): the forces a × d that carry a couple C = J a (geometry/couple.h) do the work C · ω.
  if (facet.vertices[2] == none) {
    const Vec3 along = body_vertex(facet.vertices[1]) - body_vertex(facet.vertices[0]);
    return along.cross(velocities[facet.vertices[1] - first] - velocities[facet.vertices[0] - first]) / along.squaredNorm();
  }
  std::array<Vec3, 3> arm;
  Vec3 centre = Vec3::Zero(), moment = Vec3::Zero();
  for (std::size_t k = 0; k < 3; ++k) {
    arm[k] = body_vertex(facet.vertices[k]);
    centre += arm[k] / 3;
  }
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
  for (std::size_t k = 0; k < 3; ++k) {
    arm[k] -= centre;
    inertia += arm[k].squaredNorm() * Eigen::Matrix3d::Identity() - arm[k] * arm[k].transpose();
    moment += arm[k].cross(velocities[facet.vertices[k] - first]);
  }
  return inertia.inverse() * moment;
}

void WallSet::mark(const Vec3& low, const Vec3& high, double largest_radius) {
  for (const auto w : movers_) {
    const auto& motion = walls_[w].motion;
    if (deforms(w)) {
      auto& prescribed = prescribed_[w];
      for (std::size_t k = 0; k < prescribed.marked.size(); ++k)
        prescribed.marked[k] = prescribed.position[k] + (time_ - prescribed.start) * prescribed.velocity[k];
      prescribed.travel = 0;
      prescribed.travel_time = time_;
      build_grid(w);
      continue;
    }
    auto& mark = marks_[w];
    mark.displacement = placements_[w].displacement;
    mark.angle = placements_[w].angle;
    mark.reach = extent_[w];
    if (motion.turns() && walls_[w].is_plane)
      for (int corner = 0; corner < 8; ++corner)
        mark.reach = std::max(mark.reach, from_axis(motion, Vec3(corner & 1 ? low[0] : high[0], corner & 2 ? low[1] : high[1],
                                                                 corner & 4 ? low[2] : high[2]) - mark.displacement));
    mark.reach += largest_radius;
  }
}

double WallSet::travel_since_mark() const {
  double travel = 0;
  for (const auto w : movers_) {
    if (deforms(w)) {
      const auto& prescribed = prescribed_[w];
      travel = std::max(travel, prescribed.travel + prescribed.fastest * std::abs(time_ - prescribed.travel_time));
      continue;
    }
    double moved = (placements_[w].displacement - marks_[w].displacement).norm();
    if (frames_[w].turns) moved += std::abs(placements_[w].angle - marks_[w].angle) * marks_[w].reach;
    travel = std::max(travel, moved);
  }
  return travel;
}

void WallSet::prescribe(std::size_t wall, std::span<const Vec3> displacements, std::span<const Vec3> velocities, double time) {
  auto& prescribed = prescribed_[wall];
  if (!deforms(wall) || displacements.size() != prescribed.position.size() || velocities.size() != prescribed.position.size())
    throw std::logic_error("displacements and velocities are prescribed for every vertex of a wall whose motion is prescribed");
  double farthest = 0, fastest = 0;
  for (std::size_t k = 0; k < displacements.size(); ++k) {
    prescribed.position[k] = vertices_[first_vertex_[wall] + k] + displacements[k];
    prescribed.velocity[k] = velocities[k];
    farthest = std::max(farthest, (prescribed.position[k] - prescribed.marked[k]).squaredNorm());
    fastest = std::max(fastest, velocities[k].squaredNorm());
  }
  prescribed.start = prescribed.travel_time = time;
  prescribed.travel = std::sqrt(farthest);
  prescribed.fastest = std::sqrt(fastest);
  prescribed.curve.clear();
}

void WallSet::prescribe(std::size_t wall, const Instant& start, const Instant& end, double time, double length) {
  prescribe(wall, start.displacements, start.velocities, time);
  auto& prescribed = prescribed_[wall];
  const auto count = prescribed.position.size();
  if (end.displacements.size() != count || end.velocities.size() != count || !(length > 0))
    throw std::logic_error("the end of a window is prescribed for every vertex, and after its start");
  prescribed.curve.resize(4 * count);
  prescribed.curve_start = time;
  prescribed.curve_length = length;
  double fastest = prescribed.fastest * prescribed.fastest;
  for (std::size_t k = 0; k < count; ++k) {
    const Vec3 way = end.displacements[k] - start.displacements[k], first = length * start.velocities[k], last = length * end.velocities[k];
    Vec3* const curve = &prescribed.curve[4 * k];
    curve[0] = prescribed.position[k];
    curve[1] = first;
    curve[2] = 3 * way - 2 * first - last;
    curve[3] = first + last - 2 * way;
    // The velocity is a parabola within the triangle of its Bézier points.
    fastest = std::max({fastest, end.velocities[k].squaredNorm(), ((3 * way - first - last) / length).squaredNorm()});
  }
  prescribed.fastest = std::sqrt(fastest);
}

void WallSet::follow_curve(Prescribed& prescribed) const {
  const double s = (time_ - prescribed.curve_start) / prescribed.curve_length;
  for (std::size_t k = 0; k < prescribed.position.size(); ++k) {
    const Vec3* const curve = &prescribed.curve[4 * k];
    prescribed.position[k] = curve[0] + s * (curve[1] + s * (curve[2] + s * curve[3]));
    prescribed.velocity[k] = (curve[1] + s * (2 * curve[2] + 3 * s * curve[3])) / prescribed.curve_length;
  }
  prescribed.start = time_;
}

void WallSet::begin_forces() {
  for (auto& state : servos_) state.force = 0;
}

void WallSet::add_forces(std::span<const WallResultant> resultants) {
  if (!has_servos_) return;
  for (const auto w : movers_)
    if (walls_[w].motion.kind() == Motion::Kind::servo) servos_[w].force += resultants[w].force.dot(walls_[w].motion.servo().direction);
}

void WallSet::send(std::size_t wall) {
  if (sends_[wall]) return;
  sends_[wall] = 1;
  sent_vertex_[wall] = sent_vertices_;
  sent_facet_[wall] = sent_facets_;
  sent_vertices_ += first_vertex_[wall + 1] - first_vertex_[wall];
  sent_facets_ += first_facet_[wall + 1] - first_facet_[wall];
}

void WallSet::restore() {
  for (const auto w : movers_) {
    const auto& motion = walls_[w].motion;
    if (deforms(w)) {
      build_grid(w);
    } else if (motion.kind() == Motion::Kind::servo) {
      Placement placement;
      placement.displacement = servos_[w].travel * motion.servo().direction;
      placement.velocity = servos_[w].speed * motion.servo().direction;
      place(w, placement);
    } else {
      place(w, motion.at(time_));
    }
  }
}

}  // namespace acopla::dem
