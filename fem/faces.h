// Integrals over faces of the boundary and over edges.
#pragma once

#include <functional>
#include <vector>

#include "fem/mesh.h"
#include "fem/nodal.h"

namespace acopla::fem {

/// A quadrature point of a face.
struct FacePoint {
  Eigen::VectorXd shape;  ///< shape functions of the face's nodes, in VTK's order
  Vec3 position;          ///< [m]
  /// Unit normal, outward for a face of the boundary, times weight and area [m²]; of a line (length
  /// [m]) in 2D the normal in the plane; of an edge in 3D, which has none, its length along x.
  Vec3 area;
};

/// Visits quadrature points that integrate products of two shape functions of a plane face exactly.
void visit_face(const Mesh& mesh, const BoundaryFace& face,
                const std::function<void(const FacePoint&)>& visit);

/// Area [m²] of faces; length [m] of lines.
double measure(const Mesh& mesh, const std::vector<BoundaryFace>& faces);

}  // namespace acopla::fem
