// What a contact law may know: the geometry and motion of one contact, whatever the other body is.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace acopla::dem {

using Vec3 = Eigen::Vector3d;

/// One contact of body i with body j, which is a particle, a plane, or a triangle. The normal points from j to i, so that
/// a positive normal force pushes i along it. In contact: overlap > 0.
struct Kinematics {
  double overlap;         ///< r_i + r_j − d, or r − d at a wall [m]
  double closing_speed;   ///< > 0 while the bodies approach [m/s]
  double reduced_radius;  ///< 1 / (1/r_i + 1/r_j); r_i at a wall [m]
  double reduced_mass;    ///< 1 / (1/m_i + 1/m_j); m_i at a wall [kg]
  Vec3 normal;            ///< unit
  Vec3 slip;              ///< tangential velocity of i's surface over j's at the contact point [m/s]
  Vec3 mean_spin;         ///< (ω_i + ω_j) / 2: how the contact frame turns about its normal [rad/s]
  Vec3 relative_spin;     ///< ω_i − ω_j [rad/s]
  double reduced_inertia; ///< 1 / (1/I_i + 1/I_j); I_i at a wall [kg m²]
  double step;            ///< Δt [s]
};

/// The history of a law that has none.
struct None {
  void flip() {}
};

/// Carries a tangential vector of the previous step into the present tangent plane: it turns with the mean spin about
/// the normal and tilts with the normal. Both small rotations are taken to first order and the length is then restored by
/// one step of Newton's root, to fourth order in the step's angle.
inline void turn_with_frame(Vec3& tangential, const Kinematics& k) {
  const double before = tangential.squaredNorm();
  if (!(before > 0)) return;
  tangential += (k.step * k.mean_spin.dot(k.normal)) * k.normal.cross(tangential);
  tangential -= tangential.dot(k.normal) * k.normal;
  const double after = tangential.squaredNorm();
  if (after > 0) tangential *= 0.5 * (1 + before / after);
}

}  // namespace acopla::dem
