// The loads of a structure that its case names.
#pragma once

#include <string>
#include <vector>

#include "fem/amplitude.h"
#include "fem/formulation.h"
#include "fem/part.h"
#include "io/case_table.h"

namespace acopla::fem {

/// One load, as a case describes it.
struct Load {
  enum class Kind {
    pressure,     ///< [Pa] against the outward normal of faces
    traction,     ///< [N/m²] on faces
    force,        ///< [N] in total, spread evenly over faces
    line_force,   ///< [N/m] along edges in 3D
    point_force,  ///< [N] at each of the points
  };
  explicit Load(io::Table of_case) : table(std::move(of_case)) {}

  io::Table table;
  Kind kind = Kind::pressure;
  Vec3 value = Vec3::Zero();  ///< a pressure stands in the first component
  Part part;
  std::optional<Vec3> at;  ///< of a point force: the node nearest to this place [m]
  Amplitude amplitude;
};

/// Reads [NAME.load.…]. @throws io::UserError
std::vector<Load> read_loads(const io::Table& structure, const std::vector<PhysicalGroup>& groups,
                             int dimension);

/// The nodal loads of a structure over time: some that stay and some that follow an amplitude.
class Loads {
 public:
  explicit Loads(const Mesh& mesh) : constant_(mesh.zero()) {}
  void add(const Vector& nodal) { constant_ += nodal; }
  void add(Vector nodal, const Amplitude& amplitude);

  bool constant() const { return varying_.empty(); }
  Vector at(double time) const;                 ///< [N]
  Vector mean(double start, double end) const;  ///< over a span of time [N]

 private:
  struct Varying {
    Vector nodal;
    Amplitude amplitude;
  };
  Vector constant_;
  std::vector<Varying> varying_;
};

/// Consistent nodal forces [N] of a load at amplitude 1. In 2D they are those of the structure's
/// thickness.
/// @throws io::UserError located at the load when its part is not there
Vector nodal_forces(const Load& load, const Mesh& mesh, const Formulation& formulation);

}  // namespace acopla::fem
