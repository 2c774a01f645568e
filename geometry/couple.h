// A couple as forces on nodes: what carries a moment without changing the sum of the forces.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "geometry/surface_mesh.h"

namespace acopla::geometry {

/// How a set of nodes carries couples: with a = compliance · couple, f_k = a × (x_k − centre) are
/// the forces of least norm whose sum is zero and whose moment is what of the couple the nodes can
/// carry.
struct CoupleCarrier {
  Vec3 centre;                 ///< mean of the nodes [m]
  Eigen::Matrix3d compliance;  ///< pseudo-inverse of J = Σ (|d|² I − d dᵀ), d = x_k − centre [1/m²]
  Eigen::Matrix3d lost;  ///< projector on the couples that cannot be carried: zero unless the nodes
                         ///< lie on a line
};

/// @param thinness  axes about which J is below this fraction of its largest eigenvalue carry
/// nothing. Nodes on a line
///                  carry every couple but the one about that line; nodes that coincide carry none.
CoupleCarrier couple_carrier(std::span<const Vec3> nodes, double thinness = 1e-6);

/// Forces of least norm on `nodes` whose sum is zero and whose moment is `couple` [N m]:
/// f_k = a × (x_k − x̄) with J a = couple, J = Σ (|d|² I − d dᵀ), d = x_k − x̄.
/// @param forces  written, one per node [N]
/// @return false, with zero forces, where the nodes lie so close to one line (smallest eigenvalue
/// of J below `thinness`
///         of the largest) that the couple's component about that line cannot be carried; the
///         caller reports the loss. A couple perpendicular to the line is carried: in two
///         dimensions two nodes are enough.
bool couple_forces(std::span<const Vec3> nodes, const Vec3& couple, std::span<Vec3> forces,
                   double thinness = 1e-6);

}  // namespace acopla::geometry
