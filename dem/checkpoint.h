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

/// The whole state of a checkpoint into an engine of the same scene; without `more` a run of its own begins there.
/// @throws io::UserError when it is of another scene
void read_state(const Scene& scene, Engine& engine, Traffic& traffic, const std::function<void(io::StateReader&)>& more = {});

}  // namespace acopla::dem
