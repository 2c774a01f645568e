// Where particles may be.
#pragma once

#include "dem/particles.h"
#include "dem/scene.h"

namespace acopla::dem {

/// The case's `domain`, or everything that the case names and half as much again around it [m].
geometry::Box domain_of(const Scene& scene, const Particles& particles, const WallSet& walls);

}  // namespace acopla::dem
