// What the walls receive from the particles, and its mean over a window.
#pragma once

#include <cstddef>
#include <vector>

#include "dem/contact/vector.h"

namespace acopla::dem {

class WallSet;

/// Of one wall, all contacts together, in the world's axes.
struct WallResultant {
  Vec3 force = Vec3::Zero();   ///< on the wall [N]
  Vec3 torque = Vec3::Zero();  ///< on the wall about WallSet::reference(wall) [N m], rolling couples included
  double power = 0;            ///< that the moving wall gives to the particles [W]

  WallResultant& operator+=(const WallResultant& other) {
    force += other.force;
    torque += other.torque;
    power += other.power;
    return *this;
  }
  template <class Archive>
  void state(Archive& archive) {
    archive("force", force);
    archive("torque", torque);
    archive("power", power);
  }
};

/// Forces on the walls summed over contacts and steps, of one partition.
struct WallForces {
  std::vector<WallResultant> walls;
  /// Only of the walls that are sent (WallSet::send), in the wall's body axes; see WallSet::sent_vertex and sent_facet.
  std::vector<Vec3> vertex;  ///< [N]
  std::vector<Vec3> couple;  ///< per facet: what its vertices must still receive as zero-sum forces [N m]

  template <class Archive>
  void state(Archive& archive) {
    archive("walls", walls);
    archive("vertex", vertex);
    archive("couple", couple);
  }
};

/// What the walls received, as the mean over a window: Σ F Δt / window by the trapezoidal rule, which is exactly the momentum that the
/// particles lost to them.
struct WallLoad {
  std::vector<WallResultant> walls;             ///< one a wall
  /// One list a wall, empty unless it is sent: on every vertex [N], in the wall's body axes. Force and moment of the contacts are exact.
  std::vector<std::vector<Vec3>> vertex_force;
  std::size_t couples_lost = 0;                 ///< facets too thin to carry the couple they received

  /// Adds a share of another load of the same walls; an empty one takes its shape.
  void add(const WallLoad& other, double share);
};

/// Sums the forces of a window's steps. The forces at the window's ends belong half to each of its neighbours.
///
///     sum.begin();
///     for (step …) {
///       if (last) sum.begin_last();
///       for (partition …) contacts.evaluate(…, sum.of(partition), …);   // in parallel
///     }
///     load = sum.finish(walls, steps);
class WallLoadSum {
 public:
  WallLoadSum() = default;
  WallLoadSum(const WallSet& walls, std::size_t partitions);

  /// A window begins. Before the first, the forces at its start are evaluated into of(…) after begin_last().
  void begin();
  /// The next step's forces are those at the window's end.
  void begin_last();
  /// Where a partition adds its forces.
  WallForces& of(std::size_t partition) { return at_end_ ? edge_[partition] : sum_[partition]; }
  /// The window's mean over `steps` steps.
  WallLoad finish(const WallSet& walls, double steps);

  template <class Archive>
  void state(Archive& archive) {
    archive("edge", edge_);  // between windows nothing else matters
  }

 private:
  std::vector<WallForces> sum_, edge_;  // one a partition
  bool at_end_ = true;
};

}  // namespace acopla::dem
