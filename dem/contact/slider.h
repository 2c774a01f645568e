#pragma once

#include "dem/contact/kinematics.h"

namespace acopla::dem {

/// The tangential law's spring, on which a rolling law may build its own.
template <class Real>
struct ShearSpring {
  Real stiffness;  ///< k_t [N/m]; 0 without a tangential law
  Real kept, of;   ///< where k_t has fallen since the last step, the spring keeps kept/of of its force; 1 elsewhere
  Real increment;  ///< k_t of this step's increment [N/m]
  Real share() const { return select(of > Real(0), kept / of, Real(0)); }
};

/// A spring that slides at a limit: what friction and rolling resistance have in common.
/// @param trial    the spring's force had it not slid
/// @param elastic  out: what the spring keeps: `trial`, or as much of it as the limit allows
/// @return where it slides, as a mask of the lanes
template <class Real, int size>
auto slides_at(const Vector<Real, size>& trial, const Real& limit, Vector<Real, size>& elastic) {
  elastic = shortened(trial, limit);
  return dot(trial, trial) > limit * limit;
}

/// Coulomb's friction: where the spring alone reaches the limit the contact slides and the dashpot is off (Gomes 2014, eq. 2.49–2.52);
/// else spring and dashpot act together, up to the limit.
template <class Real, int size>
Vector<Real, size> held_by_friction(const Vector<Real, size>& trial, const Real& limit, const Real& dashpot, const Vector<Real, size>& slip,
                                    Vector<Real, size>& elastic) {
  const auto slides = dot(trial, trial) > limit * limit;
  auto together = shortened(trial - select(slides, Real(0), dashpot) * slip, limit);
  elastic = select(slides, together, trial);
  return together;
}

}  // namespace acopla::dem
