// Damping beyond the contacts, for quasi-static work. A pass of its own: a scene without it never calls it.
#pragma once

#include "dem/particles.h"

namespace acopla::dem {

struct Damping {
  double translation = 0, rotation = 0;  ///< global viscous α [1/s]: F −= α m v, M −= α I ω (Gomes 2014, eq. 2.83–2.85)
  double local = 0;  ///< Cundall's non-viscous: a share of the unbalanced force, against the motion (Cundall 1987)
  bool none() const { return translation == 0 && rotation == 0 && local == 0; }
};

/// Adds the damping forces to those of the contacts of the particles first … last − 1. @return the power they take [W]
double damp(const Damping& damping, Particles& particles, const Vec3& gravity, std::uint32_t first, std::uint32_t last);

}  // namespace acopla::dem
