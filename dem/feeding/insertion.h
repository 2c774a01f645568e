// From a scene's insertions to its particles.
#pragma once

#include "dem/particles.h"
#include "dem/scene.h"

namespace acopla::dem {

/// Places every filling of the scene, clear of each other and of the walls.
/// @throws io::UserError, located at the amount, when there is no room
/// Clear of the walls as they are now.
Vacancy clear_of(const WallSet& walls);

Particles insert_particles(const Scene& scene, const WallSet& walls);

}  // namespace acopla::dem
