// A part of space where particles are put, or taken away.
#pragma once

#include <array>
#include <string>

#include "dem/contact/vector.h"
#include "dem/feeding/random.h"
#include "geometry/bucket_grid.h"

namespace acopla::dem {

/// Volume of a sphere (dimension 3) [m³], or of a disc of unit depth (dimension 2) [m³ per metre of depth].
double particle_volume(double radius, int dimension);
/// "sphere" or "disc".
const char* particle_word(int dimension);

/// A box, a sphere or a cylinder; in two dimensions a rectangle or a disc in the plane z = 0.
class Region {
 public:
  /// Two opposite corners in any order [m].
  static Region box(const Vec3& one, const Vec3& other, int dimension);
  static Region ball(const Vec3& centre, double radius, int dimension);
  /// Three dimensions; `from` and `to` are the centres of its ends, not the same point.
  static Region cylinder(const Vec3& from, const Vec3& to, double radius);

  /// One of the walls that bound the region, seen from a point.
  struct Face {
    double distance = 0;         ///< of the point from the wall [m]; negative outside
    Vec3 inward = Vec3::Zero();  ///< unit normal
  };
  struct Faces {
    std::array<Face, 6> face;
    int count = 0;
    const Face* begin() const { return face.data(); }
    const Face* end() const { return face.data() + count; }
  };
  Faces faces(const Vec3& at) const;

  int dimension() const { return dimension_; }
  /// True where a whole particle of that radius is inside.
  bool contains(const Vec3& centre, double radius = 0) const;
  /// True where a particle of that radius fits into the region at all.
  bool holds(double radius) const;
  double volume() const;  ///< [m³]; two dimensions: of unit depth
  geometry::Box bounds() const;
  Vec3 centre() const;
  bool is_box() const { return shape_ == Shape::box; }
  /// Uniform in the part where whole particles of that radius have their centres; the region must hold one.
  Vec3 random_point(Random& random, double radius = 0) const;
  std::string text() const;  ///< "the box [0, 0, 0] to [1, 1, 1.6]"

 private:
  enum class Shape { box, ball, cylinder };
  Region(Shape shape, int dimension) : shape_(shape), dimension_(dimension) {}
  Shape shape_;
  int dimension_;
  Vec3 low_ = Vec3::Zero(), high_ = Vec3::Zero();  // corners; the ends of a cylinder; low_ is the centre of a ball
  double radius_ = 0;
};

}  // namespace acopla::dem
