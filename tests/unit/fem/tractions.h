// Consistent nodal loads of tractions on a surface, and its areas, by quadrature on its faces.
#pragma once

#include <functional>

#include "geometry/surface_mesh.h"

namespace acopla::fem::test {

using geometry::Vec3;

/// Visits the quadrature points of a face.
/// @param visit  (shape functions in VTK's order, point, outward unit normal times weight)
void integrate(const geometry::SurfaceMesh& surface, std::size_t face,
               const std::function<void(const Eigen::VectorXd&, const Vec3&, const Vec3&)>& visit);

/// ∫ N_a t dA [N] at each point of the surface. @param traction  t(point, unit normal) [Pa]
std::vector<Vec3> traction_loads(const geometry::SurfaceMesh& surface,
                                 const std::function<Vec3(const Vec3&, const Vec3&)>& traction);

}  // namespace acopla::fem::test
