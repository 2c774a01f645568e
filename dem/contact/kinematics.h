// What a contact law may know: the geometry and motion of one contact, whatever the other body is.
#pragma once

#include <algorithm>
#include <cmath>

#include "dem/contact/vector.h"
#include "dem/simd.h"

namespace acopla::dem {

/// One contact of body i with body j, which is a particle, a plane, or an element of a mesh; or a pack of such contacts, where Real
/// is a pack. The normal points from j to i, so that a positive normal force pushes i along it. In contact: overlap > 0; a law is
/// also called with overlap 0 for lanes that do not touch, and must stay finite there (its force is thrown away).
///
/// Time. Particles move with their velocities of half steps, x_n − x_{n−1} = Δt v_{n−½}, so a spring of slip or of rolling that adds up
/// Δt times the rates below follows the motion exactly. Dashpots want the rate at the whole step: closing_speed is extrapolated to it
/// (3/2 v_{n−½} − 1/2 v_{n−3/2}), which keeps impacts of second order; slip and spins are those of the half step.
///
/// In three dimensions slip and spins are vectors. In two they have one component: slip along the tangent (−n_y, n_x), spins about
/// the axis out of the plane. A law that is written with `+`, `−`, `dot` and `shortened` serves both.
template <class Real_, int dimension_>
struct Kinematics {
  using Real = Real_;
  static constexpr int dimension = dimension_;
  static constexpr int turns = dimension == 2 ? 1 : 3;  ///< components of slip and spins
  using Turn = Vector<Real, turns>;

  Real overlap;                      ///< r_i + r_j − d, or r − d at a wall [m], ≥ 0
  Real closing_speed;                ///< > 0 while the bodies approach, at the whole step [m/s]
  Real reduced_radius;               ///< 1 / (1/r_i + 1/r_j); r_i at a wall [m]
  Real reduced_mass;                 ///< 1 / (1/m_i + 1/m_j); m_i at a wall [kg]
  Vector<Real, dimension> normal;    ///< unit
  Turn slip;                         ///< tangential velocity of i's surface over j's at the contact point, at the half step [m/s]
  Real frame_spin;                   ///< n · (ω_i + ω_j) / 2: how the contact frame turns about its normal, half step [rad/s]; 0 in two dimensions
  Turn relative_spin;                ///< ω_i − ω_j, half step [rad/s]
  Real reduced_inertia;              ///< 1 / (1/I_i + 1/I_j); I_i at a wall [kg m²]
  Real rolling_inertia;              ///< 1 / (1/(I_i + m_i r_i²) + 1/(I_j + m_j r_j²)) (Gomes 2014, eq. 2.103); I_i + m_i r_i² at a wall
  double step;                       ///< Δt [s]
};

/// Carries a tangential vector of the previous step into the present tangent plane: it turns with the frame about the normal and tilts
/// with the normal. Both small rotations are taken to first order and the length is then restored by
/// one step of Newton's root, to fourth order in the step's angle. A vector that lay out of the plane by more than 45° is
/// not stretched back to its length: it is round-off, and would grow with every step. In the plane the tangent turns by itself.
/// @param part, whole  part/whole of it is kept, e.g. where a spring softens; nothing where the whole is 0. Two numbers, so that one division
///                     serves this quotient and the root's: dividing is what a law waits for
template <class K>
typename K::Turn turned_with_frame(const typename K::Turn& before, const K& k, const typename K::Real& part = typename K::Real(1),
                                   const typename K::Real& whole = typename K::Real(1)) {
  using Real = typename K::Real;
  if constexpr (K::dimension == 2) return select(whole > Real(0), part / whole, Real(0)) * before;
  else {
    using std::min;
    const Real length = dot(before, before);
    typename K::Turn after = before + (k.step * k.frame_spin) * cross(k.normal, before);
    after = after - dot(after, k.normal) * k.normal;
    const Real kept = dot(after, after);
    const Real divisor = whole * kept;
    return select(divisor > Real(0), 0.5 * part * (kept + min(length, 2.0 * kept)) / divisor, Real(0)) * after;
  }
}

/// Component by component, lane by lane.
template <class Mask, class Real>
Vector<Real, 1> select(const Mask& mask, const Vector<Real, 1>& yes, const Vector<Real, 1>& no) {
  return {select(mask, yes.x, no.x)};
}
template <class Mask, class Real>
Vector<Real, 3> select(const Mask& mask, const Vector<Real, 3>& yes, const Vector<Real, 3>& no) {
  return {select(mask, yes.x, no.x), select(mask, yes.y, no.y), select(mask, yes.z, no.z)};
}

/// The vector, or where it is longer than `limit`, as much of it as has that length.
template <class Real, int size>
Vector<Real, size> shortened(const Vector<Real, size>& vector, const Real& limit) {
  using std::sqrt, std::min, std::max;
  if constexpr (size == 1) return {max(-limit, min(limit, vector.x))};
  else {
    const Real square = dot(vector, vector);
    return select(square > limit * limit, limit / sqrt(square), Real(1)) * vector;
  }
}

/// What a law stores from step to step. It decides how the numbers change when the two bodies of a contact change names (the
/// particles were sorted anew): a force or torque on i is the opposite of that on j, except that in the plane a force is a number along
/// the tangent, which turns round with the normal.
enum class Stored { force, torque, scalar };

}  // namespace acopla::dem
