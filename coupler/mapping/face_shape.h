// Shape functions of the faces a surface may be made of, and their inverse: the point of a face
// nearest to a point.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <span>

#include "geometry/bucket_grid.h"
#include "geometry/surface_mesh.h"

namespace acopla::coupler {

using geometry::FaceKind;
using geometry::Vec3;
using Vec2 = Eigen::Vector2d;

inline constexpr std::size_t max_face_nodes = 9;

/// One value per node of a face, in VTK's order; zero beyond the face's nodes.
using FaceValues = std::array<double, max_face_nodes>;

/// Lagrange shape functions at the parameters (ξ, η). Lines: ξ in [−1, 1], η = 0. Triangles: ξ, η ≥
/// 0, ξ + η ≤ 1, node 1 at ξ = 1 and node 2 at η = 1. Quads: [−1, 1]², corners (−1, −1), (1, −1),
/// (1, 1), (−1, 1).
FaceValues shape_functions(FaceKind kind, const Vec2& parameters);

/// Shape functions with their first and second derivatives by ξ (u) and η (v).
struct FaceBasis {
  FaceValues value{}, u{}, v{}, uu{}, uv{}, vv{};
};
FaceBasis shape_basis(FaceKind kind, const Vec2& parameters);

/// Parameters of the nodes of a kind, in VTK's order.
std::span<const Vec2> node_parameters(FaceKind kind);

/// A box that holds every point of the face [m], not only its nodes: a curved edge may bulge past
/// them. It is the box of the face's Bézier points.
geometry::Box box_of_face(FaceKind kind, std::span<const Vec3> nodes);

struct FaceProjection {
  FaceValues weights{};  ///< shape functions at the projected point; sum 1 to round-off, may be
                         ///< negative on quadratic faces
  Vec2 parameters;       ///< of the projected point, inside the face
  Vec3 point;            ///< the projected point Px [m]
  double distance = 0;   ///< |x − Px| [m]
  int iterations = 0;    ///< Newton steps; 0 where the answer is closed
  bool converged =
      true;  ///< false: the best point found, on the face but perhaps not the nearest of it
};

/// The point of a face nearest to `x`. line2, triangle3 and parallelograms are exact. The others are minimised by
/// Newton's method on ½|x − X(ξ, η)|², each step solving its quadratic model exactly inside the
/// parameter domain (which is what an active set would find), with Gauss–Newton and growing damping
/// where the model is not convex or the distance does not decrease. The start is the nearest point
/// of the face's triangles (of its segments, for lines) through all its nodes: exact for affine
/// faces, which therefore take one step. On faces so curved that a point sees several local minima,
/// the one that the start leads to is returned.
/// @param nodes  the face's nodes [m], as many as its kind has
FaceProjection project_on_face(FaceKind kind, std::span<const Vec3> nodes, const Vec3& x);

}  // namespace acopla::coupler
