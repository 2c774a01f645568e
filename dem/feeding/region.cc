#include "dem/feeding/region.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace acopla::dem {
namespace {

// In the unit ball (or disc) by rejection: π/6 (π/4) of the tries hit.
Vec3 random_in_ball(Random& random, int dimension) {
  Vec3 point = Vec3::Zero();
  do {
    for (int d = 0; d < dimension; ++d) point[d] = 2 * random.uniform() - 1;
  } while (point.squaredNorm() > 1);
  return point;
}

std::string point_text(const Vec3& point, int dimension) {
  return dimension == 2 ? fmt::format("[{:.6g}, {:.6g}]", point[0], point[1])
                        : fmt::format("[{:.6g}, {:.6g}, {:.6g}]", point[0], point[1], point[2]);
}

}  // namespace

double particle_volume(double radius, int dimension) {
  return dimension == 2 ? M_PI * radius * radius : 4.0 / 3.0 * M_PI * radius * radius * radius;
}

const char* particle_word(int dimension) { return dimension == 2 ? "disc" : "sphere"; }

Region Region::box(const Vec3& one, const Vec3& other, int dimension) {
  Region region(Shape::box, dimension);
  region.low_ = one.cwiseMin(other);
  region.high_ = one.cwiseMax(other);
  if (dimension == 2) region.low_[2] = region.high_[2] = 0;
  return region;
}

Region Region::ball(const Vec3& centre, double radius, int dimension) {
  Region region(Shape::ball, dimension);
  region.low_ = centre;
  if (dimension == 2) region.low_[2] = 0;
  region.radius_ = radius;
  return region;
}

Region Region::cylinder(const Vec3& from, const Vec3& to, double radius) {
  Region region(Shape::cylinder, 3);
  region.low_ = from;
  region.high_ = to;
  region.radius_ = radius;
  return region;
}

Region::Faces Region::faces(const Vec3& at) const {
  Faces faces;
  const auto add = [&](double distance, const Vec3& inward) { faces.face[static_cast<std::size_t>(faces.count++)] = {distance, inward}; };
  // The wall around `offset`, the way of the point from the centre or axis; on the axis any direction is as good.
  const auto add_round = [&](const Vec3& offset, const Vec3& on_axis) {
    const double length = offset.norm();
    add(radius_ - length, length > 0 ? Vec3(-offset / length) : on_axis);
  };
  if (shape_ == Shape::box) {
    for (int d = 0; d < dimension_; ++d) {
      add(at[d] - low_[d], Vec3::Unit(d));
      add(high_[d] - at[d], -Vec3::Unit(d));
    }
  } else if (shape_ == Shape::ball) {
    add_round(at - low_, Vec3::UnitX());
  } else {
    const Vec3 axis = (high_ - low_).normalized(), offset = at - low_;
    const double along = offset.dot(axis);
    add(along, axis);
    add((high_ - low_).norm() - along, -axis);
    add_round(offset - along * axis, axis.unitOrthogonal());
  }
  return faces;
}

bool Region::contains(const Vec3& centre, double radius) const {
  for (const auto& face : faces(centre))
    if (face.distance < radius) return false;
  return true;
}

bool Region::holds(double radius) const {
  if (shape_ == Shape::box) return (high_ - low_).head(dimension_).minCoeff() >= 2 * radius;
  return radius_ >= radius && (shape_ == Shape::ball || (high_ - low_).norm() >= 2 * radius);
}

double Region::volume() const {
  if (shape_ == Shape::box) return (high_ - low_).head(dimension_).prod();
  return shape_ == Shape::ball ? particle_volume(radius_, dimension_) : M_PI * radius_ * radius_ * (high_ - low_).norm();
}

geometry::Box Region::bounds() const {
  if (shape_ == Shape::box) return {low_, high_};
  if (shape_ == Shape::ball) {
    Vec3 reach = Vec3::Constant(radius_);
    if (dimension_ == 2) reach[2] = 0;
    return {low_ - reach, low_ + reach};
  }
  // A disc normal to the axis reaches r sqrt(1 − a_d²) in direction d.
  const Vec3 axis = (high_ - low_).normalized();
  const Vec3 reach = radius_ * (1 - axis.array().square()).max(0).sqrt().matrix();
  return {low_.cwiseMin(high_) - reach, low_.cwiseMax(high_) + reach};
}

Vec3 Region::centre() const { return shape_ == Shape::ball ? low_ : Vec3((low_ + high_) / 2); }

Vec3 Region::random_point(Random& random, double radius) const {
  if (shape_ == Shape::box) {
    Vec3 at = low_;
    for (int d = dimension_ - 1; d >= 0; --d) at[d] = low_[d] + radius + (high_[d] - low_[d] - 2 * radius) * random.uniform();
    return at;
  }
  if (shape_ == Shape::ball) return low_ + (radius_ - radius) * random_in_ball(random, dimension_);
  const Vec3 axis = (high_ - low_).normalized(), side = axis.unitOrthogonal(), other = axis.cross(side);
  const double along = radius + ((high_ - low_).norm() - 2 * radius) * random.uniform();
  const Vec3 disc = (radius_ - radius) * random_in_ball(random, 2);
  return low_ + along * axis + disc[0] * side + disc[1] * other;
}

std::string Region::text() const {
  if (shape_ == Shape::box) return fmt::format("the box {} to {}", point_text(low_, dimension_), point_text(high_, dimension_));
  if (shape_ == Shape::ball)
    return fmt::format("the {} of radius {:.6g} m at {}", particle_word(dimension_), radius_, point_text(low_, dimension_));
  return fmt::format("the cylinder of radius {:.6g} m from {} to {}", radius_, point_text(low_, 3), point_text(high_, 3));
}

}  // namespace acopla::dem
