// What a contact law may know: the geometry and motion of one contact, whatever the other body is.
#pragma once

#include <algorithm>
#include <cmath>

#include "dem/contact/pair_properties.h"
#include "dem/contact/vector3.h"
#include "dem/simd.h"

namespace acopla::dem {

/// One contact of body i with body j, which is a particle, a plane, or a triangle; or four such contacts, where Real is
/// Double4. The normal points from j to i, so that a positive normal force pushes i along it. In contact: overlap > 0.
template <class Real>
struct Kinematics {
  Real overlap;                 ///< r_i + r_j − d, or r − d at a wall [m]
  Real closing_speed;           ///< > 0 while the bodies approach [m/s]
  Real reduced_radius;          ///< 1 / (1/r_i + 1/r_j); r_i at a wall [m]
  Real reduced_mass;            ///< 1 / (1/m_i + 1/m_j); m_i at a wall [kg]
  Vector3<Real> normal;         ///< unit
  Vector3<Real> slip;           ///< tangential velocity of i's surface over j's at the contact point [m/s]
  Vector3<Real> mean_spin;      ///< (ω_i + ω_j) / 2: how the contact frame turns about its normal [rad/s]
  Vector3<Real> relative_spin;  ///< ω_i − ω_j [rad/s]
  Real reduced_inertia;         ///< 1 / (1/I_i + 1/I_j); I_i at a wall [kg m²]
  double step;                  ///< Δt [s]
};

/// What a spring of friction carries from step to step; four doubles, so that it is stored as one Record.
template <class Real>
struct SpringHistory {
  Vector3<Real> force;  ///< elastic tangential force on i [N]
  Real stiffness;       ///< of the last step [N/m]
};

/// Carries a tangential vector of the previous step into the present tangent plane: it turns with the mean spin about
/// the normal and tilts with the normal. Both small rotations are taken to first order and the length is then restored by
/// one step of Newton's root, to fourth order in the step's angle. A vector that lay out of the plane by more than 45° is
/// not stretched back to its length: it is round-off, and would grow with every step.
template <class Real>
Vector3<Real> turned_with_frame(const Vector3<Real>& before, const Kinematics<Real>& k) {
  using std::min;
  const Real length = dot(before, before);
  Vector3<Real> after = before + (k.step * dot(k.mean_spin, k.normal)) * cross(k.normal, before);
  after = after - dot(after, k.normal) * k.normal;
  const Real kept = dot(after, after);
  return select(kept > Real(0), 0.5 * (1.0 + min(length / kept, Real(2))), Real(0)) * after;
}

/// The vector, or where it is longer than `limit`, as much of it as has that length.
template <class Real>
Vector3<Real> shortened(const Vector3<Real>& vector, const Real& limit) {
  using std::sqrt;
  const Real square = dot(vector, vector);
  return select(square > limit * limit, limit / sqrt(square), Real(1)) * vector;
}

}  // namespace acopla::dem
