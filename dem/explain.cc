#include "dem/explain.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "dem/contact/restitution.h"
#include "dem/engine.h"
#include "dem/feeding/insertion.h"
#include "dem/step.h"

namespace acopla::dem {
namespace {

// Seconds a particle-step of this scene's kernel, measured on what the settled scene will look like: a lattice of touching particles of
// the first filling's mean size, from the lower corner of the walls and regions against gravity, between the scene's own walls.
double measure_particle_step(const Scene& scene, double step, std::size_t expected) {
  const bool plane = scene.dimension == 2;
  const auto material = scene.particle_materials().front();
  const double radius = std::sqrt(scene.smallest_radius(material) * scene.largest_radius());
  const double spacing = 2 * radius * (1 - 1e-4);
  const auto regions = scene.regions();
  Vec3 low = Vec3::Zero(), high = Vec3::Constant(40 * radius);
  if (!regions.empty()) {
    low = regions.front().low;
    high = regions.front().high;
  }
  Eigen::Index up = plane ? 1 : 2;
  if (!scene.gravity.isZero(0)) scene.gravity.cwiseAbs().maxCoeff(&up);
  const bool falls_up = scene.gravity[up] > 0;
  const auto along = [&](Eigen::Index d) {
    return plane && d == 2 ? 1 : std::max(1, static_cast<int>((high[d] - low[d]) / spacing));
  };
  const Eigen::Index side = plane ? 1 - up : (up + 1) % 3, other = plane ? 2 : (up + 2) % 3;
  Particles particles;
  particles.kind = scene.kind();
  const auto count = std::clamp<std::size_t>(expected, 1, 20000);
  // Walls may reach into the lattice (glued particles do): sites inside them stay empty.
  const WallSet walls(scene.walls);
  const auto clear = clear_of(walls);
  const int layers = static_cast<int>(2 * count) + 100;
  for (int layer = 0; particles.size() < count && layer < layers; ++layer)
    for (int j = 0; j < along(other) && particles.size() < count; ++j)
      for (int i = 0; i < along(side) && particles.size() < count; ++i) {
        Vec3 at;
        at[side] = low[side] + (i + 0.5) * spacing;
        at[other] = plane ? 0 : low[other] + (j + 0.5) * spacing;
        at[up] = falls_up ? high[up] - (layer + 0.5) * spacing : low[up] + (layer + 0.5) * spacing;
        if (clear(at, 0.9 * radius)) particles.add(at, radius, scene.materials[material].density, material, Vec3::Zero());
      }
  const auto placed = std::max<std::size_t>(1, particles.size());
  const auto engine = make_engine(scene, std::move(particles));
  engine->advance(2, step * 1e-3);  // so short that nothing moves
  const auto begin = std::chrono::steady_clock::now();
  const auto elapsed = [&] { return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count(); };
  std::uint64_t steps = 0;
  for (; elapsed() < 0.1; steps += 10) engine->advance(10, step * 1e-3);
  return elapsed() / static_cast<double>(steps * placed);
}

// "1 plane, 2 lines of 7 segments"
std::string walls_of(const Scene& scene) {
  std::size_t planes = 0, surfaces = 0, facets = 0, glued = 0;
  for (const auto& wall : scene.walls) {
    (wall.is_plane ? planes : surfaces) += 1;
    glued += wall.glued_diameter > 0;
    facets += wall.mesh.triangles.size();
    if (!wall.line.empty()) facets += wall.line.size() - (wall.closed ? 0 : 1);
  }
  const auto counted = [](std::size_t count, const std::string& one, const std::string& many) { return fmt::format("{} {}", count, count == 1 ? one : many); };
  std::vector<std::string> parts;
  if (planes) parts.push_back(counted(planes, "plane", "planes"));
  if (surfaces && scene.dimension == 2) parts.push_back(counted(surfaces, "line", "lines") + " of " + counted(facets, "segment", "segments"));
  if (surfaces && scene.dimension == 3) parts.push_back(counted(surfaces, "mesh", "meshes") + " of " + counted(facets, "triangle", "triangles"));
  if (glued) parts.push_back(fmt::format("{} of them covered with glued particles", glued));
  return parts.empty() ? "none" : fmt::format("{}", fmt::join(parts, ", "));
}

std::string left_out(const Scene& scene, std::size_t meshes, std::size_t planes) {
  std::vector<std::string> out;
  const auto sets = scene.law_sets();
  const auto all = [&](auto&& without) { return std::all_of(sets.begin(), sets.end(), without); };
  if (all([](const LawSet& set) { return set.tangential == "none"; })) out.emplace_back("friction and its history");
  if (all([](const LawSet& set) { return set.rolling == "none"; })) out.emplace_back("rolling resistance");
  if (!scene.rotates()) out.emplace_back("rotation");
  if (meshes == 0) out.emplace_back(scene.dimension == 2 ? "walls of segments" : "triangle walls");
  if (planes == 0) out.emplace_back("planes");
  if (std::none_of(scene.walls.begin(), scene.walls.end(), [](const Wall& wall) { return wall.motion.moves(); })) out.emplace_back("moving walls");
  if (scene.damping.none()) out.emplace_back("damping beyond the contacts");
  if (!scene.keeps_ledger) out.emplace_back("energy ledger");
  if (scene.threads == 1) out.emplace_back("threads");
  out.emplace_back("bonds");
  return fmt::format("{}", fmt::join(out, ", "));
}

}  // namespace

std::string explain(const io::Table& root, const std::string& name) {
  auto scene = read_scene(root, name);
  const double limit = largest_step(scene, root.table(name));
  scene.keeps_ledger |= watches_energy(scene, limit);
  const auto critical = critical_step(scene);
  const double end = root.number("end", io::positive);
  const auto coupling = root.table_or_empty("coupling");
  const double window = coupling.is_number("window") ? coupling.number("window", io::positive) : end;
  const double steps_a_window = std::ceil(window / limit * (1 - 1e-12)), step = window / steps_a_window;
  const double steps = steps_a_window * std::round(end / window);
  // Half of what the inlets bring is there on average; who leaves by then is not known.
  double fed = 0;
  for (const auto& inlet : scene.inlets)
    fed += inlet.rate * std::max(0.0, std::min(end, inlet.until) - inlet.from) / (inlet.density * inlet.sizes.mean_volume());
  const double count = static_cast<double>(scene.particle_count()) + fed / 2;

  std::size_t meshes = 0, planes = 0;
  for (const auto& wall : scene.walls) (wall.is_plane ? planes : meshes) += 1;
  Particles none;
  none.kind = scene.kind();
  const auto costs = make_engine(scene, none)->costs();
  const double seconds = measure_particle_step(scene, step, static_cast<std::size_t>(count)) * count * steps;

  std::string text;
  const auto line = [&](const char* what, const std::string& value) { text += fmt::format("  {:22} {}\n", what, value); };
  line("particles", fmt::format("{} {}", scene.particle_count(), scene.dimension == 2 ? "discs" : "spheres"));
  if (!scene.inlets.empty()) line("inlets", fmt::format("{:.0f} more in {:.6g} s", fed, end));
  for (const auto& set : scene.law_sets()) line("laws", set.text());
  line("walls", walls_of(scene));
  line("left out", left_out(scene, meshes, planes));
  line("bytes a particle", fmt::format("{}", costs.bytes_per_particle));
  line("bytes a contact", fmt::format("{}", costs.bytes_per_contact));
  line("critical step", fmt::format("{:.4g} s ({})", critical.seconds, critical.reason));
  line("step", fmt::format("{:.4g} s, {:.2f} of critical; {:.0f} a window, {:.0f} in all", step, step / critical.seconds, steps_a_window, steps));
  for (const auto i : scene.particle_materials())
    for (std::size_t j = 0; j < scene.materials.size(); ++j) {
      const auto& pair = scene.pair(i, j);
      if (pair.laws.normal != "hertz" && pair.laws.normal != "linear") continue;
      const bool hertz = pair.laws.normal == "hertz";
      const auto& shape = hertz ? hertz_impact : linear_impact;
      const double alpha = hertz ? pair.hertz_damping * std::sqrt(1.5) : 2 * pair.damping_ratio;
      // A gentle impact: 1 m/s between spheres of the smallest size, in units of that impact.
      const double radius = scene.smallest_radius(i) / 2;
      const double mass = scene.materials[i].density * volume_of(scene.dimension, 2 * radius) / 2;
      const double unit = hertz ? std::pow(mass / (4.0 / 3.0 * pair.modulus * std::sqrt(radius)), 0.4) : std::sqrt(mass / pair.stiffness);
      const double got = integrated_restitution(shape, alpha, step / unit);
      line("restitution", fmt::format("{}–{}: {:.3f} asked, {:.4f} at this step in an impact of 1 m/s (error {:+.4f})", scene.materials[i].name,
                                      scene.materials[j].name, pair.restitution, got, got - pair.restitution));
    }
  line("expected run time", fmt::format("{:.3g} s on one core", seconds));
  return text;
}

}  // namespace acopla::dem
