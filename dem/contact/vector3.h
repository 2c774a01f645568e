// A vector of three components, each one number or four lanes of SIMD.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace acopla::dem {

using Vec3 = Eigen::Vector3d;

template <class Real>
struct Vector3 {
  Real x, y, z;

  Vector3() = default;
  Vector3(const Real& x_, const Real& y_, const Real& z_) : x(x_), y(y_), z(z_) {}
  explicit Vector3(const Vec3& v) : x(v[0]), y(v[1]), z(v[2]) {}
  Vec3 vector() const { return {x, y, z}; }

  friend Vector3 operator+(const Vector3& a, const Vector3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  friend Vector3 operator-(const Vector3& a, const Vector3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  friend Vector3 operator-(const Vector3& a) { return {-a.x, -a.y, -a.z}; }
  friend Vector3 operator*(const Real& s, const Vector3& a) { return {s * a.x, s * a.y, s * a.z}; }
};

template <class Real>
Real dot(const Vector3<Real>& a, const Vector3<Real>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

template <class Real>
Vector3<Real> cross(const Vector3<Real>& a, const Vector3<Real>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

}  // namespace acopla::dem
