#include "dem/checkpoint.h"

#include <fmt/format.h>

#include "dem/start_from.h"
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

}  // namespace

void write_checkpoint(const std::string& path, const Scene& scene, const Engine& engine, const Traffic& traffic,
                      const std::function<void(io::StateWriter&)>& more) {
  CheckpointHead head;
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

void read_state(const Scene& scene, Engine& engine, Traffic& traffic, const std::function<void(io::StateReader&)>& more) {
  const auto [state, info] = io::read_checkpoint(scene.start_from->file);
  if (info.program_version != program_version || info.case_hash != description(scene))
    throw io::UserError(scene.start_from->where, fmt::format("start_from = \"{}\" is the state of another scene ({} of {}): materials, laws, walls, partitions, inlets and the "
                            "energy ledger must be the same to go on bit by bit. Use take = \"particles\".",
                            scene.start_from->file, info.participant, info.program_version));
  CheckpointHead head;
  io::StateReader reader(state);
  reader("head", head);
  reader("engine", engine);
  reader("traffic", traffic);
  if (!more) return;
  more(reader);
  reader.finish();
}

}  // namespace acopla::dem
