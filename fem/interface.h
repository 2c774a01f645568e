// The surface through which a structure is coupled.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "fem/mesh.h"
#include "fem/nodal.h"

namespace acopla::fem {

/// Faces of a physical group, of the element's own order; lines in 2D. Its points are nodes of the
/// mesh in ascending order.
class Interface {
 public:
  /// @throws std::invalid_argument as Mesh::boundary
  Interface(const Mesh& mesh, const std::string& group);

  const geometry::SurfaceMesh& surface() const { return surface_; }
  /// Node of the mesh at each point.
  const std::vector<std::uint32_t>& nodes() const { return nodes_; }
  /// Adds forces at the points [N] to nodal loads. They are nodal already: the mapping of the
  /// coupler has integrated them against the shape functions of the faces.
  /// @throws std::invalid_argument when there is not one finite force a point
  void add_forces(std::span<const Vec3> forces, Vector& load) const;
  /// Values of a nodal field at the points.
  std::vector<Vec3> values(const Vector& nodal) const;

 private:
  int dimension_;
  std::vector<std::uint32_t> nodes_;
  geometry::SurfaceMesh surface_;
};

}  // namespace acopla::fem
