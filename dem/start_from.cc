#include "dem/start_from.h"

#include <fmt/format.h>

#include <algorithm>

#include "io/archive.h"
#include "io/checkpoint.h"

namespace acopla::dem {
namespace {

// The head of the checkpoint, its materials numbered as in the scene.
CheckpointHead read_head(const StartFrom& start, const Scene& scene, io::StateReader& reader) {
  CheckpointHead head;
  reader("head", head);
  if (head.dimension != scene.dimension)
    throw io::UserError(start.where, fmt::format("start_from = \"{}\" holds particles of {} dimensions, and the case has {}.", start.file,
                                                 head.dimension, scene.dimension));
  head.particles.kind = {head.dimension, head.rotates};
  for (auto& material : head.particles.material) {
    const auto& name = head.materials[material];
    const auto found = std::find_if(scene.materials.begin(), scene.materials.end(), [&](const Material& m) { return m.name == name; });
    if (found == scene.materials.end())
      throw io::UserError(start.where, fmt::format("start_from = \"{}\" holds particles of {}, which is not in {}.material. Add it.", start.file,
                                                   name, scene.name));
    material = static_cast<std::uint8_t>(found - scene.materials.begin());
  }
  return head;
}

}  // namespace

std::vector<StartFrom::Content> contents_of(const StartFrom& start, const Scene& scene) {
  const auto state = io::read_checkpoint(start.file).first;
  io::StateReader reader(state);
  const auto particles = read_head(start, scene, reader).particles;
  std::vector<StartFrom::Content> contents;
  for (std::size_t i = 0; i < particles.size(); ++i) {
    const double radius = particles.radius_of(i);
    auto content = std::find_if(contents.begin(), contents.end(), [&](const auto& c) { return c.material == particles.material[i]; });
    if (content == contents.end()) content = contents.insert(contents.end(), {particles.material[i], 0, radius, radius});
    ++content->count;
    content->smallest_radius = std::min(content->smallest_radius, radius);
    content->largest_radius = std::max(content->largest_radius, radius);
  }
  return contents;
}

Particles read_particles(const Scene& scene) {
  const auto state = io::read_checkpoint(scene.start_from->file).first;
  io::StateReader reader(state);
  const auto old = read_head(*scene.start_from, scene, reader).particles;
  Particles particles;
  particles.kind = scene.kind();
  for (std::size_t i = 0; i < old.size(); ++i) {
    particles.add(old.position[i].vector(), old.radius_of(i), scene.materials[old.material[i]].density, old.material[i], old.velocity_of(i),
                  old.spin_of(i));
    particles.id.back() = old.id[i];
  }
  particles.next_id = old.next_id;
  return particles;
}

}  // namespace acopla::dem
