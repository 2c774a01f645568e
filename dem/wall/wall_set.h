// The walls of a scene: planes, facets (triangles, or segments in two dimensions) and glued balls in one numbered set, where they are
// now, and which of them a particle may touch.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dem/contact/vector.h"
#include "dem/particles.h"
#include "dem/wall/load.h"
#include "dem/wall/motion.h"
#include "geometry/bucket_grid.h"
#include "io/stl.h"

namespace acopla::dem {

/// A named wall of the case: one plane, a triangle mesh, or in two dimensions a line of segments. Mesh and line may be covered with
/// glued particles, which then are what the particles touch (Gomes 2014, §2.3).
struct Wall {
  std::string name;
  std::uint8_t material = 0;
  bool is_plane = false;
  Vec3 point = Vec3::Zero(), normal = Vec3::UnitZ();  ///< of the plane; particles stay where (x − point)·normal > 0
  io::TriangleMesh mesh;                              ///< of a mesh
  std::vector<Vec3> line;                             ///< corners of a line [m], z = 0
  bool closed = false;                                ///< the line's last corner joins its first
  double glued_diameter = 0;                          ///< [m]; 0: the facets themselves are touched
  double glued_spacing = 0;                           ///< least distance of neighbouring glued particles along an edge [m]; 0: the diameter
  Motion motion;
};

/// Where a particle's surface comes nearest to an element.
struct NearestPoint {
  std::uint32_t element = 0;
  double distance = 0;             ///< from the centre [m]; a plane's may be negative (the centre is behind it)
  Vec3 point = Vec3::Zero();       ///< on the element [m]
  Vec3 normal = Vec3::Zero();      ///< unit, from the element to the centre
  std::array<double, 3> weights{}; ///< of the facet's vertices: barycentric weights of `point`, of a ball those of its centre
  std::array<std::uint32_t, 3> feature{};  ///< vertices of the edge or corner it lies on
  std::uint8_t feature_size = 0;           ///< 0: inside the element; 1: at a vertex; 2: on an edge
};

class WallSet {
 public:
  static constexpr std::uint32_t none = static_cast<std::uint32_t>(-1);

  explicit WallSet(std::vector<Wall> walls);

  bool empty() const { return walls_.empty(); }
  const std::vector<Wall>& walls() const { return walls_; }
  std::size_t element_count() const { return element_wall_.size(); }
  std::uint32_t wall_of(std::uint32_t element) const { return element_wall_[element]; }

  /// Elements are numbered: facets, then planes, then balls. Facets of glued walls have numbers, but nothing touches them.
  bool is_facet(std::uint32_t element) const { return element < facets_.size(); }
  bool is_plane(std::uint32_t element) const { return !is_facet(element) && element < facets_.size() + planes_.size(); }
  bool is_ball(std::uint32_t element) const { return element >= facets_.size() + planes_.size(); }
  /// Vertices of a facet, numbered through all walls; the third of a segment is `none`.
  const std::array<std::uint32_t, 3>& facet(std::uint32_t element) const { return facets_[element].vertices; }
  std::size_t vertices_of(std::uint32_t facet) const { return facets_[facet].vertices[2] == none ? 2 : 3; }
  /// The facet that carries an element's load: itself, or the one under a ball; none for planes.
  std::uint32_t carrier(std::uint32_t element) const;
  double curvature(std::uint32_t element) const { return is_ball(element) ? 1 / balls_[ball_index(element)].radius : 0; }
  std::size_t ball_count() const { return balls_.size(); }
  std::uint32_t first_vertex(std::size_t wall) const { return first_vertex_[wall]; }
  std::uint32_t first_facet(std::size_t wall) const { return first_facet_[wall]; }

  /// A vertex now, in its wall's body axes [m]: only prescribed walls move in them.
  Vec3 body_vertex(std::uint32_t vertex) const;
  /// The same in the world.
  Vec3 vertex(std::uint32_t vertex) const;
  /// All vertices of a wall now, in the world [m].
  std::vector<Vec3> positions(std::size_t wall) const;
  /// Centres and radii (w) of the glued particles of a wall now.
  std::vector<Record> glued_particles(std::size_t wall) const;
  /// The wall as the case gives it, for a coupling. @throws std::logic_error for a plane
  geometry::SurfaceMesh surface(std::size_t wall) const;
  /// Box around all vertices and glued particles now; nothing where all walls are planes.
  std::optional<geometry::Box> bounds() const;

  /// Elements within `reach` of a point, in ascending order, appended to `found`. Prescribed walls are found where
  /// they were at the last mark().
  void find_near(const Vec3& centre, double reach, std::vector<std::uint32_t>& found) const;
  /// True when the element is nearer than `radius`; then `nearest` is filled, in the world's axes.
  bool touches(std::uint32_t element, const Vec3& centre, double radius, NearestPoint& nearest) const;

  // Motion.

  /// Some wall is not fixed.
  bool move_at_all() const { return !movers_.empty(); }
  /// Some wall of this material may turn or deform, so that contacts with it need its angular velocity.
  bool turn_at_all(std::uint8_t material) const;
  bool has_servos() const { return has_servos_; }
  /// Brings all moving walls to `time`, at the end of a step of length `step`; servos act on the forces of the last evaluation.
  void move(double time, double step);
  /// Velocity of the wall's material at a point of an element [m/s].
  Vec3 velocity_at(const NearestPoint& contact) const;
  Vec3 rigid_velocity(std::size_t wall, const Vec3& point) const {
    const auto& frame = frames_[wall];
    return frame.velocity + frame.spin.cross(point - frame.reference);
  }
  /// Angular velocity of an element [rad/s]; of a facet that deforms, the one that does the work of a couple on its vertices.
  Vec3 spin_of(std::uint32_t element) const;
  /// Point about which torques on the wall are given, now [m]: the centre of a motion that turns; else the plane's point or the mean of
  /// the vertices, moving with the wall (a prescribed wall's stays).
  const Vec3& reference(std::size_t wall) const { return frames_[wall].reference; }
  const Vec3& velocity(std::size_t wall) const { return frames_[wall].velocity; }  ///< of the reference, of a rigid wall [m/s]
  const Vec3& shift(std::size_t wall) const { return frames_[wall].shift; }        ///< world = rotation · body + shift [m]
  /// From body to world axes.
  const Eigen::Matrix3d& rotation(std::size_t wall) const { return frames_[wall].rotation; }

  /// Lists of contacts are made now.
  /// @param low, high  box that holds all particles' centres [m]: how far a plane that turns can matter
  /// @param largest_radius  of the particles [m]
  void mark(const Vec3& low, const Vec3& high, double largest_radius);
  /// Bound of how far any point of any wall that particles in the marked box may touch has moved since mark() [m].
  double travel_since_mark() const;

  /// What a coupled solver says at the start of a window: the surface is at x₀ + displacement and moves at `velocity` until the next call.
  /// One vector a vertex of the wall, whose motion must be prescribed(). @param time  of the clock that move() gets
  void prescribe(std::size_t wall, std::span<const Vec3> displacements, std::span<const Vec3> velocities, double time);
  /// The same where the window's end is assumed too: in between every vertex follows Hermite's cubic. @param length  of the window [s]
  struct Instant {
    std::span<const Vec3> displacements, velocities;
  };
  void prescribe(std::size_t wall, const Instant& start, const Instant& end, double time, double length);

  /// Forces of the present step, for servos: begin, then every partition's WallContactList::resultants().
  void begin_forces();
  void add_forces(std::span<const WallResultant> resultants);
  double servo_travel(std::size_t wall) const { return servos_[wall].travel; }  ///< along its direction [m]
  double servo_speed(std::size_t wall) const { return servos_[wall].speed; }    ///< [m/s]

  // What is sent.

  /// Forces on the vertices of this wall are wanted. Before contacts and sums are made.
  void send(std::size_t wall);
  bool sends(std::size_t wall) const { return sends_[wall]; }
  std::size_t sent_vertices() const { return sent_vertices_; }
  std::size_t sent_facets() const { return sent_facets_; }
  /// Places in WallForces of a vertex and a facet of a wall that is sent.
  std::size_t sent_vertex(std::size_t wall, std::uint32_t vertex) const { return vertex - first_vertex_[wall] + sent_vertex_[wall]; }
  std::size_t sent_facet(std::size_t wall, std::uint32_t facet) const { return facet - first_facet_[wall] + sent_facet_[wall]; }

  template <class Archive>
  void state(Archive& archive) {
    archive("time", time_);
    archive("servos", servos_);
    archive("marks", marks_);
    archive("prescribed", prescribed_);
    if constexpr (Archive::reading) restore();
  }

  // What the contact lists need to know of elements.

  /// The vertices of this wall move against each other: its facets have no body of their own.
  bool deforms(std::size_t wall) const { return frames_[wall].deforms; }
  bool turns(std::size_t wall) const { return frames_[wall].turns; }
  bool moves(std::size_t wall) const { return frames_[wall].moves; }
  Vec3 to_body(std::size_t wall, const Vec3& world) const {
    const auto& frame = frames_[wall];
    if (!frame.moves) return world;
    return frame.turns ? Vec3(frame.rotation.transpose() * (world - frame.shift)) : Vec3(world - frame.shift);
  }
  Vec3 to_world(std::size_t wall, const Vec3& body) const {
    const auto& frame = frames_[wall];
    if (!frame.moves) return body;
    return frame.turns ? Vec3(frame.rotation * body + frame.shift) : Vec3(body + frame.shift);
  }
  /// A plane, or the plane of a facet of a wall that does not deform, in body axes: normal, and in w normal · x on it [m].
  Record flat(std::uint32_t element) const;
  /// The same in the world now.
  Record to_world(std::size_t wall, const Record& flat) const;
  /// Barycentric weights of the foot of a point in body axes on a facet of a wall that does not deform; negative beyond an edge.
  std::array<double, 3> foot_weights(std::uint32_t facet, const Vec3& body) const;
  /// The foot of `centre` lies inside the facet, and does so wherever the centre moves by `travel`. Never for walls that deform.
  bool holds_foot(std::uint32_t facet, const Vec3& centre, double travel) const;
  /// The nearest point of `facet` lies on an edge or vertex that it shares with `other`, and does so wherever the centre moves by
  /// `travel`: then keep_contacts() never keeps it beside a contact inside `other`.
  bool yields_to(std::uint32_t facet, std::uint32_t other, const Vec3& centre, double travel) const;
  struct BallNow {
    Vec3 centre;
    double radius;
  };
  BallNow ball(std::uint32_t element) const;
  const std::array<double, 3>& ball_weights(std::uint32_t element) const { return balls_[ball_index(element)].weights; }

 private:
  // In body axes of a wall that does not deform. With y = x − centre: height = normal · y, weight_k = 1/size + gradient_k · y.
  // What turns most candidates away comes first, in one line of the cache.
  struct alignas(64) Facet {
    Vec3 centre;
    double radius;  // of the ball around the centre that holds the vertices [m]
    Vec3 normal;
    std::uint32_t wall;
    std::array<std::uint32_t, 3> vertices;
    std::array<Vec3, 3> gradient;
    std::array<double, 3> square_height;  // of the vertices over the edges opposite [m²]
  };
  struct Plane {
    Vec3 point, normal;  // now, in the world
    std::uint32_t wall;
  };
  struct Ball {
    std::uint32_t facet;
    std::array<double, 3> weights;
    Vec3 centre;  // in body axes, where the wall does not deform
    double radius;
  };
  struct Frame {
    bool moves = false, turns = false;  // as a rigid body
    bool deforms = false;
    Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
    Vec3 shift = Vec3::Zero();  // x = rotation · body + shift
    Vec3 velocity = Vec3::Zero(), spin = Vec3::Zero();
    Vec3 reference = Vec3::Zero();
  };
  struct ServoState {
    double travel = 0, speed = 0, force = 0;  // force: of the particles along the direction [N]
  };
  struct Mark {
    Vec3 displacement = Vec3::Zero();
    double angle = 0, reach = 0;  // reach: farthest point from the axis that matters [m]

    template <class Archive>
    void state(Archive& archive) {
      archive("displacement", displacement);
      archive("angle", angle);
      archive("reach", reach);
    }
  };
  struct Prescribed {
    std::vector<Vec3> position, velocity, marked;  // at `start`; at the last mark
    double start = 0, fastest = 0;                 // largest |velocity|
    double travel = 0, travel_time = 0;            // largest distance from `marked` at that time
    // Only between two known instants: four a vertex, x = p + s (q + s (r + s c)), s from 0 to 1.
    std::vector<Vec3> curve;
    double curve_start = 0, curve_length = 0;

    template <class Archive>
    void state(Archive& archive) {
      archive("position", position);
      archive("velocity", velocity);
      archive("marked", marked);
      archive("start", start);
      archive("fastest", fastest);
      archive("travel", travel);
      archive("travel_time", travel_time);
      archive("curve", curve);
      archive("curve_start", curve_start);
      archive("curve_length", curve_length);
    }
  };

  void follow_curve(Prescribed& prescribed) const;
  std::size_t ball_index(std::uint32_t element) const { return element - facets_.size() - planes_.size(); }
  void add_facet(std::uint32_t wall, const std::array<std::uint32_t, 3>& vertices);
  void glue(std::uint32_t wall);
  void add_ball(std::uint32_t wall, std::uint32_t facet, const std::array<double, 3>& weights);
  void find_middle(std::size_t wall);
  void build_grid(std::size_t wall);
  void place(std::size_t wall, const Placement& placement);
  void restore();
  bool touches_facet(const Facet& facet, const Vec3& body, double radius, NearestPoint& nearest) const;
  // Nearest point by regions, whatever the place; normal and distance too.
  void find_nearest(const Facet& facet, const Vec3& body, NearestPoint& nearest) const;

  std::vector<Wall> walls_;
  std::vector<Vec3> vertices_;  // as the case gives them
  std::vector<Facet> facets_;
  std::vector<Plane> planes_;
  std::vector<Ball> balls_;
  std::vector<std::uint32_t> element_wall_, vertex_wall_;
  std::vector<std::uint32_t> first_vertex_, first_facet_, first_ball_, plane_of_;
  std::vector<std::optional<geometry::BucketGrid>> grids_;  // in body axes; none for planes
  std::vector<Frame> frames_;
  std::vector<Placement> placements_;
  std::vector<Mark> marks_;
  std::vector<ServoState> servos_;
  std::vector<Prescribed> prescribed_;  // empty members unless prescribed
  std::vector<std::uint32_t> movers_;   // walls that move
  std::vector<Vec3> middle_;            // of each wall in the case, see reference()
  std::vector<double> extent_;          // of each wall's points from its motion's axis
  double time_ = 0;
  bool has_servos_ = false;
  std::vector<std::uint8_t> sends_;
  std::vector<std::size_t> sent_vertex_, sent_facet_;
  std::size_t sent_vertices_ = 0, sent_facets_ = 0;
};

}  // namespace acopla::dem
