// A surface that moves by itself along what stands, while it sends forces: where it is, and how it has turned.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <span>
#include <vector>

#include "coupler/case.h"
#include "geometry/surface_mesh.h"

namespace acopla::coupler {

/// Follows one rigid surface window by window. Forces are means over a window and belong to the middle of its motion, so that places and directions
/// are of second order in the window.
class Travel {
 public:
  /// @param surface  where it stands in its mesh; must outlive this
  /// @param displacement  when coupled time begins, one per point [m]; empty: it stands there
  Travel(const InterfaceCase& interface, const geometry::SurfaceMesh& surface, int dimension, std::span<const geometry::Vec3> displacement);

  /// On by a window. @param displacement  at its end, one per point [m]
  /// @throws Failure where the surface deforms, or turns by more than a radian
  void go_on(std::span<const geometry::Vec3> displacement);

  /// The surface in the middle of the window.
  const geometry::SurfaceMesh& midway() const { return midway_; }
  /// It is not where it was in the window before.
  bool has_moved() const { return has_moved_; }
  /// Forces in the axes of the surface, which turn with it, in those of the world in the middle of the window [N].
  std::vector<geometry::Vec3> turned(std::span<const geometry::Vec3> forces) const;

  template <class Archive>
  void state(Archive& archive) {
    archive("displacement", start_);
  }

 private:
  Eigen::Quaterniond turn_of(std::span<const geometry::Vec3> displacement) const;

  const InterfaceCase& interface_;
  const geometry::SurfaceMesh& surface_;
  int dimension_;
  std::vector<geometry::Vec3> start_;  // displacement when the window begins
  geometry::SurfaceMesh midway_;
  Eigen::Quaterniond turn_ = Eigen::Quaterniond::Identity();  // from the mesh to the middle of the window
  bool has_moved_ = false;
};

}  // namespace acopla::coupler
