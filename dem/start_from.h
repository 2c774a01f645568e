// The particles of another run's checkpoint, without the engine that made it.
#pragma once

#include <string>
#include <vector>

#include "dem/particles.h"
#include "dem/scene.h"

namespace acopla::dem {

/// The head of a state, which a run with other walls and laws can read too.
struct CheckpointHead {
  int dimension = 3;
  bool rotates = true;
  std::vector<std::string> materials;
  Particles particles;

  template <class Archive>
  void state(Archive& archive) {
    archive("dimension", dimension);
    archive("rotates", rotates);
    archive("materials", materials);
    archive("particles", particles);
  }
};

/// What is in a checkpoint, by materials of the scene. @throws io::UserError, located at start_from, when it is no checkpoint, of another
/// dimension, or has a material the scene does not know
std::vector<StartFrom::Content> contents_of(const StartFrom& start, const Scene& scene);

/// The particles of a checkpoint: places, sizes, materials by name, velocities; ids are kept.
Particles read_particles(const Scene& scene);

}  // namespace acopla::dem
