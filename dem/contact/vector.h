// Small vectors of components that are each one number or a pack of SIMD lanes.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace acopla::dem {

using Vec3 = Eigen::Vector3d;

/// A vector of one, two or three components. One: what is a scalar in the plane (slip along the tangent, spin).
template <class Real, int size>
struct Vector;

template <class Real>
struct Vector<Real, 1> {
  Real x;
  friend Vector operator+(const Vector& a, const Vector& b) { return {a.x + b.x}; }
  friend Vector operator-(const Vector& a, const Vector& b) { return {a.x - b.x}; }
  friend Vector operator-(const Vector& a) { return {-a.x}; }
  friend Vector operator*(const Real& s, const Vector& a) { return {s * a.x}; }
  friend Real dot(const Vector& a, const Vector& b) { return a.x * b.x; }
};

template <class Real>
struct Vector<Real, 2> {
  Real x, y;
  friend Vector operator+(const Vector& a, const Vector& b) { return {a.x + b.x, a.y + b.y}; }
  friend Vector operator-(const Vector& a, const Vector& b) { return {a.x - b.x, a.y - b.y}; }
  friend Vector operator-(const Vector& a) { return {-a.x, -a.y}; }
  friend Vector operator*(const Real& s, const Vector& a) { return {s * a.x, s * a.y}; }
  friend Real dot(const Vector& a, const Vector& b) { return a.x * b.x + a.y * b.y; }
};

template <class Real>
struct Vector<Real, 3> {
  Real x, y, z;
  friend Vector operator+(const Vector& a, const Vector& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  friend Vector operator-(const Vector& a, const Vector& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  friend Vector operator-(const Vector& a) { return {-a.x, -a.y, -a.z}; }
  friend Vector operator*(const Real& s, const Vector& a) { return {s * a.x, s * a.y, s * a.z}; }
  friend Real dot(const Vector& a, const Vector& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
  friend Vector cross(const Vector& a, const Vector& b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
};

/// All components zero.
template <class Real, int size>
Vector<Real, size> zero_vector() {
  if constexpr (size == 1) return {Real(0)};
  else if constexpr (size == 2) return {Real(0), Real(0)};
  else return {Real(0), Real(0), Real(0)};
}

}  // namespace acopla::dem
