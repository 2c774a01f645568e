// What LIGGGHTS's contacts with mesh walls do to the vertices, summed over the steps of a window.
#pragma once

#include <array>
#include <vector>

#include "dem/contact/vector.h"
#include "liggghts/deck.h"

namespace LAMMPS_NS {
class FixContactPropertyAtom;
class LAMMPS;
}  // namespace LAMMPS_NS

namespace acopla::liggghts {

/// Of one process's particles, or of all after the sum over processes. Forces act on the walls.
struct WallForces {
  /// Per wall, the meshes first, then the planes: force [N], and of meshes torque about the mean of the vertices [N m].
  std::vector<std::array<dem::Vec3, 2>> walls;
  std::vector<dem::Vec3> vertex;  ///< of all meshes, one after another [N]
  std::vector<dem::Vec3> couple;  ///< per triangle: what its vertices must still receive as forces of zero sum [N m]
};

/// LIGGGHTS keeps of every contact with a mesh the force and the torque on the particle, and where it is (`fix wall/gran … store_force_contact
/// yes store_force_contact_stress yes`). The force is spread to the triangle's vertices by the barycentric weights of the point of
/// contact, and what of its moment that leaves out is a couple of the triangle: force and moment are exact.
class WallSums {
 public:
  WallSums(LAMMPS_NS::LAMMPS* liggghts, const Deck& deck);

  /// The forces of this instant are those at the start of the next window.
  void begin_at_rest();
  /// A window of so many steps; half of what the last instant had belongs to it.
  void begin(std::uint64_t steps);
  /// After the forces of every step.
  void add_step();
  /// Mean over the window: the trapezoidal rule, which is exactly the momentum that the particles lost to the walls.
  std::vector<double> mean() const;

  /// From the numbers of mean(), summed over processes, to one list of forces [N] a mesh.
  /// @param lost  counts triangles too thin to carry their couple
  static std::vector<std::vector<dem::Vec3>> on_vertices(const Deck& deck, const std::vector<double>& mean, std::size_t& lost);

 private:
  struct Place {
    LAMMPS_NS::FixContactPropertyAtom *forces, *points;
    std::size_t first_vertex, first_triangle;
    dem::Vec3 reference;
  };
  void collect(WallForces& forces) const;
  void collect_mesh(std::size_t mesh, WallForces& forces) const;
  void collect_plane(std::size_t plane, WallForces& forces) const;

  LAMMPS_NS::LAMMPS* liggghts_;
  const Deck& deck_;
  std::vector<Place> places_;
  WallForces sum_, now_;
  std::uint64_t steps_ = 0, done_ = 0;
};

}  // namespace acopla::liggghts
