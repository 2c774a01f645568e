#include "dem/checkpoint.h"

#include <fmt/format.h>

#include <algorithm>

#include "io/checkpoint.h"

namespace acopla::dem {
namespace {

constexpr const char* program_version = "acopla-dem 0.1.0";

// What decides how a state is laid out. Two scenes with the same description can read each other's states.
std::string description(const Scene& scene) {
  std::string text = fmt::format("{}D {} partitions", scene.dimension, scene.partitions);
  for (const auto& material : scene.materials) text.append(1, ' ').append(material.name);
  for (const auto& pair : scene.pairs) text.append(1, ' ').append(pair.laws.text());
  for (const auto& wall : scene.walls) text.append(1, ' ').append(wall.name);
  text += fmt::format(" {} {} {}", scene.inlets.size(), scene.outlets.size(), scene.keeps_ledger);
  return io::hash_of(text);
}

// The head of a state, which a run with other walls and laws can read too.
struct Head {
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

// The head of the checkpoint, its materials numbered as in the scene.
Head read_head(const StartFrom& start, const Scene& scene, io::StateReader& reader) {
  Head head;
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

void write_checkpoint(const std::string& path, const Scene& scene, const Engine& engine, const Traffic& traffic,
                      const std::function<void(io::StateWriter&)>& more) {
  Head head;
  head.dimension = scene.dimension;
  head.rotates = scene.rotates();
  for (const auto& material : scene.materials) head.materials.push_back(material.name);
  head.particles = engine.particles();
  io::State state;
  io::StateWriter writer(state);
  writer("head", head);
  writer("engine", engine);
  writer("traffic", traffic);
  more(writer);
  io::write_checkpoint(path, state, {program_version, scene.name, engine.time(), 0, description(scene)});
}

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

void read_state(const Scene& scene, Engine& engine, Traffic& traffic, const std::function<void(io::StateReader&)>& more) {
  const auto [state, info] = io::read_checkpoint(scene.start_from->file);
  if (info.program_version != program_version || info.case_hash != description(scene))
    throw io::UserError(scene.start_from->where, fmt::format("start_from = \"{}\" is the state of another scene ({} of {}): materials, laws, walls, partitions, inlets and the "
                            "energy ledger must be the same to go on bit by bit. Use take = \"particles\".",
                            scene.start_from->file, info.participant, info.program_version));
  Head head;
  io::StateReader reader(state);
  reader("head", head);
  reader("engine", engine);
  reader("traffic", traffic);
  if (!more) return;
  more(reader);
  reader.finish();
}

}  // namespace acopla::dem
