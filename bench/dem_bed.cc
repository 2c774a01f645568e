// What a step of a bed costs: dem_bed CASE [--warm N] [--steps N] [--repeats N] [--tile NX NY EDGE]. The bed is what the case inserts, or
// the checkpoint it starts from, which `--tile` repeats NX times along x and NY times along y, EDGE [m] apart: a bed that was settled
// between walls so far apart fits beside itself. After `--warm` steps the same number of steps is timed again and again, rebuilds of the
// lists and walls included. Prints one JSON object; `seconds` are a step's.
#include <fmt/format.h>
#include <malloc.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <exception>
#include <string>
#include <vector>

#include "dem/checkpoint.h"
#include "dem/start_from.h"
#include "dem/engine.h"
#include "dem/feeding/insertion.h"
#include "dem/neighbours.h"
#include "dem/step.h"
#include "dem/traffic.h"

namespace {

using namespace acopla::dem;

struct Settings {
  std::string file;
  std::uint64_t warm = 100, steps = 100, repeats = 5;
  std::size_t along_x = 1, along_y = 1;
  double edge = 0;
};

// False where the command line is not understood.
bool understood(int argc, char** argv, Settings& settings) {
  for (int k = 1; k < argc; ++k) {
    const auto takes = [&](const char* name, int values) { return std::strcmp(argv[k], name) == 0 && k + values < argc; };
    if (takes("--warm", 1)) settings.warm = std::stoull(argv[++k]);
    else if (takes("--steps", 1)) settings.steps = std::stoull(argv[++k]);
    else if (takes("--repeats", 1)) settings.repeats = std::stoull(argv[++k]);
    else if (takes("--tile", 3)) {
      settings.along_x = std::stoull(argv[++k]);
      settings.along_y = std::stoull(argv[++k]);
      settings.edge = std::stod(argv[++k]);
    } else if (argv[k][0] != '-' && settings.file.empty()) settings.file = argv[k];
    else return false;
  }
  return !settings.file.empty() && settings.steps > 0 && settings.repeats > 0;
}

Particles tiled(const Scene& scene, const Particles& tile, const Settings& settings) {
  if (settings.along_x * settings.along_y == 1) return tile;
  Particles bed;
  bed.kind = tile.kind;
  for (std::size_t x = 0; x < settings.along_x; ++x)
    for (std::size_t y = 0; y < settings.along_y; ++y)
      for (std::size_t i = 0; i < tile.size(); ++i) {
        const Vec3 at = tile.position[i].vector() + settings.edge * Vec3(static_cast<double>(x), static_cast<double>(y), 0);
        bed.add(at, tile.radius_of(i), scene.materials[tile.material[i]].density, tile.material[i], tile.velocity_of(i), tile.spin_of(i));
      }
  return bed;
}

std::size_t touching_pairs(const Particles& particles) {
  HierarchicalGrid grid;
  PairList pairs;
  grid.build(particles.position, 0);
  grid.find_pairs(0, static_cast<std::uint32_t>(particles.size()), pairs);
  return pairs.size();
}

// What this process has in use of the heap [bytes].
double in_use() {
  const auto info = mallinfo2();
  return static_cast<double>(info.uordblks + info.hblkhd);
}

// As the solver steps: with inlets and outlets, in pieces.
void advance(Engine& engine, Traffic& traffic, std::uint64_t steps, double step) {
  if (traffic.none()) return engine.advance(steps, step);
  const auto pause = traffic.steps_between(step);
  for (std::uint64_t done = 0; done < steps; done += pause) {
    traffic.visit(engine);
    engine.advance(std::min(pause, steps - done), step);
  }
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const auto middle = values.size() / 2;
  return values.size() % 2 ? values[middle] : 0.5 * (values[middle - 1] + values[middle]);
}

void measure(const Settings& settings) {
  const auto root = acopla::io::Table::from_file(settings.file);
  auto scene = read_scene(root, "grains");
  const double step = largest_step(scene, root.table("grains"));
  const double before = in_use();
  WallSet walls(scene.walls);
  const double with_walls = in_use();
  std::size_t triangles = 0;
  for (auto& wall : scene.walls) triangles += wall.mesh.triangles.size();
  Engine engine(scene, tiled(scene, scene.start_from ? read_particles(scene) : insert_particles(scene, walls), settings), std::move(walls));
  Traffic traffic(scene);
  advance(engine, traffic, settings.warm, step);
  const auto rebuilds = engine.rebuilds(), refreshes = engine.refreshes();
  std::vector<double> seconds;
  for (std::uint64_t k = 0; k < settings.repeats; ++k) {
    const auto begin = std::chrono::steady_clock::now();
    advance(engine, traffic, settings.steps, step);
    seconds.push_back(std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() / static_cast<double>(settings.steps));
  }
  const double now = in_use();  // before the grid that counts the contacts
  const auto& particles = engine.particles();
  const auto count = static_cast<double>(particles.size());
  const auto touching = touching_pairs(particles);
  const double at_median = median(seconds), at_best = *std::min_element(seconds.begin(), seconds.end());
  const auto costs = engine.costs();
  const auto ratio = engine.step_ratio(step);
  fmt::print(R"({{"particles":{},"touching":{},"on_walls":{},"near":{},"listed":{},"rebuilds":{},"refreshes":{},"steps":{},"step":{:.6g},)",
             particles.size(), touching, engine.contact_count() - touching, engine.near_pairs(), engine.listed_pairs(),
             engine.rebuilds() - rebuilds, engine.refreshes() - refreshes, settings.steps * settings.repeats, step);
  fmt::print(R"("seconds_median":{:.6g},"seconds_min":{:.6g},"rate":{:.6g},"ns_particle":{:.6g},"ns_touching":{:.6g},)", at_median, at_best,
             count / at_median / 1e6, at_median / count * 1e9, at_median / static_cast<double>(std::max<std::size_t>(1, touching)) * 1e9);
  fmt::print(R"("bytes_particle":{},"bytes_contact":{},"heap_particle":{:.1f},"triangles":{},"bytes_triangle":{:.1f},)", costs.bytes_per_particle,
             costs.bytes_per_contact, (now - with_walls) / count, triangles, triangles ? (with_walls - before) / static_cast<double>(triangles) : 0.0);
  fmt::print(R"("kinetic_energy":{:.6g},"worst_overlap":{:.4g},"step_ratio":{:.4g}}})", engine.kinetic_energy(), engine.worst_overlap(), ratio.value);
  fmt::print("\n");
}

}  // namespace

int main(int argc, char** argv) {
  Settings settings;
  if (!understood(argc, argv, settings)) {
    fmt::print(stderr, "usage: dem_bed CASE [--warm N] [--steps N] [--repeats N] [--tile NX NY EDGE]\n");
    return 2;
  }
  try {
    measure(settings);
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 1;
  }
}
