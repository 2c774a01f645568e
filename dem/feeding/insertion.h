// From a scene's insertions to its particles.
#pragma once

#include "dem/particles.h"
#include "dem/scene.h"

namespace acopla::dem {

/// Places every insertion of the scene at random, larger spheres first, clear of each other and of the walls' triangles.
/// @throws io::UserError, located at the count, when a sphere finds no place in 20,000 tries
Particles insert_particles(const Scene& scene, const WallSet& walls, bool rotates);

}  // namespace acopla::dem
