// Saving a scene's state to a file, and starting another run from it.
#pragma once

#include <functional>
#include <string>

#include "dem/engine.h"
#include "dem/traffic.h"
#include "io/archive.h"

namespace acopla::dem {

/// Everything that a run needs to go on bit by bit; `more` appends what the run itself has to remember.
void write_checkpoint(const std::string& path, const Scene& scene, const Engine& engine, const Traffic& traffic,
                      const std::function<void(io::StateWriter&)>& more);

/// What is in a checkpoint, by materials of the scene. @throws io::UserError, located at start_from, when it is no checkpoint, of another
/// dimension, or has a material the scene does not know
std::vector<StartFrom::Content> contents_of(const StartFrom& start, const Scene& scene);

/// The particles of a checkpoint: places, sizes, materials by name, velocities; ids are kept.
Particles read_particles(const Scene& scene);

/// The whole state of a checkpoint into an engine of the same scene; without `more` a run of its own begins there.
/// @throws io::UserError when it is of another scene
void read_state(const Scene& scene, Engine& engine, Traffic& traffic, const std::function<void(io::StateReader&)>& more = {});

}  // namespace acopla::dem
