// Resultants of nodal forces, for the ledger of what a mapping kept.
#pragma once

#include <span>

#include "geometry/surface_mesh.h"

namespace acopla::coupler {

using geometry::Vec3;

/// Sums over the points of a surface, compensated (Knuth 1969) so that their own round-off stays
/// below 1e-15 of `size` and `turning_size` whatever the number of points.
struct Resultant {
  Vec3 force = Vec3::Zero();   ///< Σ F [N]
  Vec3 moment = Vec3::Zero();  ///< Σ (x − about) × F [N m]
  double size = 0;             ///< Σ |F| [N]
  double turning_size = 0;     ///< Σ |x − about| |F| [N m]
};

/// @param points, forces  of the same length [m], [N]; @param about  point that moments are taken
/// about [m]
/// @throws std::invalid_argument when the lengths differ
Resultant resultant(std::span<const Vec3> points, std::span<const Vec3> forces, const Vec3& about);

/// What was lost (or made) between two resultants about the same point, as fractions of what was
/// sent.
struct Loss {
  double force = 0;   ///< |ΔΣF| / Σ|F|
  double moment = 0;  ///< |ΔΣM| / Σ|r||F|, of the side where that is larger
};

/// Zero where nothing was sent and nothing received; infinite where something was received that
/// nobody sent.
Loss loss(const Resultant& sent, const Resultant& received);

}  // namespace acopla::coupler
