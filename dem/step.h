// How long a step may be.
#pragma once

#include <string>

#include "dem/scene.h"

namespace acopla::dem {

struct CriticalStep {
  double seconds = 0;  ///< the shortest of all limits [s]
  std::string reason;  ///< which limit it is, e.g. "Rayleigh wave through glass spheres of 0.04 m"
};

/// The critical step of a scene before it runs: the Rayleigh time of the particles' materials,
/// T_R = π r sqrt(ρ/G) / (0.1631 ν + 0.8766), where they have elastic constants, less for strong dashpots; and for linear springs
/// (2/ω)(sqrt(1 + 4 ζ²) − 2 ζ) with ω² = 2 Σ k_c / (D m) over the neighbours of a dense packing in D dimensions and ζ of all their
/// dashpots together. While it runs, Engine::step_ratio() bounds the limit over the contacts there are.
CriticalStep critical_step(const Scene& scene);

/// The step of a scene before windows divide it: `step`, or step_fraction × critical.
/// @throws io::UserError when it is above critical and the case does not insist
double largest_step(const Scene& scene, const io::Table& table);

}  // namespace acopla::dem
