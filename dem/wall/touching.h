// From the elements that a particle overlaps to the contacts it has: one on a split plane, two or three in a corner.
#pragma once

#include <span>
#include <vector>

#include "dem/wall/wall_set.h"

namespace acopla::dem {

/// Removes from `found` (elements nearer than the radius) those that are not contacts of their own: a nearest point on an
/// edge or a vertex that a nearer element holds too is no local minimum of the distance. Sorts by distance, ties by
/// element; keeps the first of points that coincide within round-off.
void keep_contacts(const WallSet& walls, double radius, std::vector<NearestPoint>& found);

/// Weight of every contact of one particle, in (0, 1]. Two faces that meet in a nearly flat concave crease share one
/// patch of contact: where both are touched, their weights add up to 1, so that the response is continuous in the
/// dihedral angle and across the crease; where the crease itself is out of reach of the sphere (a true corner), both are 1.
///
/// For two planes at heights h_a, h_b whose normals have cosine c, the crease is at d² = (h_a² + h_b² − 2 c h_a h_b)/(1 − c²)
/// from the centre and the feet of the two contacts are at q_a = (h_b − c h_a)/s, q_b = (h_a − c h_b)/s from it. The share
/// m = (r − d) / min(δ_a, δ_b), clamped to [0, 1], is 1 where a foot reaches the crease (d = h there), and 0 where the
/// crease leaves the sphere; then w_a = 1 / (1 + Σ_b m q_b / q_a).
void share_creases(double radius, std::span<const NearestPoint> contacts, std::span<double> weights);

/// The share m of two contacts, see above.
double crease_share(double radius, const NearestPoint& a, const NearestPoint& b);

}  // namespace acopla::dem
