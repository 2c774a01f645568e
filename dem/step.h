// How long a step may be.
#pragma once

#include <string>

#include "dem/scene.h"

namespace acopla::dem {

struct CriticalStep {
  double seconds = 0;  ///< the shortest of all limits [s]
  std::string reason;  ///< which limit it is, e.g. "Rayleigh time of glass spheres of 0.04 m"
};

/// The critical step of a scene before it runs. With springs whose stiffness does not depend on the overlap it is the stability limit of
/// leapfrog (dem/stability.h) in a dense packing of the smallest particles in a corner of the walls, all springs and dashpots of their laws
/// together. With Hertz it is the Rayleigh time of the particles' materials, T_R = π r sqrt(ρ/G) / (0.1631 ν + 0.8766), less for strong
/// dashpots, of which one takes a fifth, or less where a fifth would not be stable in such a packing squeezed to an overlap of 1 % of the
/// radius. While the scene runs, Engine::step_ratio() tells the limit of the contacts there are.
CriticalStep critical_step(const Scene& scene);

/// Whether a run keeps the energy ledger without being asked. From half the critical step on an impact may make energy while all contacts that
/// last are still stable; the ledger sees that and stops the run. With allow_unstable_step nothing is watched.
bool watches_energy(const Scene& scene, double step);

/// The step of a scene before windows divide it: `step`, or step_fraction × critical.
/// @throws io::UserError when it is above critical and the case does not insist
double largest_step(const Scene& scene, const io::Table& table);

}  // namespace acopla::dem
