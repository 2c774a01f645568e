#include "liggghts/solver.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include "dem/feeding/insertion.h"
#include "dem/start_from.h"
#include "dem/step.h"

namespace acopla::liggghts {
namespace {

namespace fs = std::filesystem;

dem::Scene read(const io::Table& root, const std::string& name) {
  const auto table = root.table(name);
  table.integer("processes", 1, 65536, 1);  // the launcher's key
  auto scene = dem::read_scene(root, name);
  check(scene, table);
  return scene;
}

std::string private_folder() {
  std::string pattern = (fs::temp_directory_path() / "acopla-liggghts-XXXXXX").string();
  if (!mkdtemp(pattern.data())) throw std::runtime_error("no folder can be made in " + fs::temp_directory_path().string());
  return pattern;
}

}  // namespace

Solver::Solver(const io::Table& root, const std::string& name, std::unique_ptr<Team>& team)
    : scene_(read(root, name)), largest_step_(dem::largest_step(scene_, root.table(name))), team_(team) {}

Solver::~Solver() {
  engine_.reset();
  std::error_code ignored;
  if (folder_is_ours_) fs::remove_all(folder_, ignored);
}

void Solver::check_uses(const protocol::Run& run) {
  std::vector<std::string> names;
  for (const auto& wall : scene_.walls)
    if (!wall.is_plane) names.push_back(wall.name);
  for (const auto& use : run.uses) {
    const auto found = std::find(names.begin(), names.end(), use.surface);
    if (found == names.end()) {
      const auto nearest = io::nearest_word(use.surface, names);
      throw io::UserError(fmt::format("{} has no wall {} with vertices.{}", scene_.name, use.surface,
                                      nearest ? fmt::format(" Did you mean {}?", *nearest) : " Planes have none to couple."));
    }
    if (!use.receives.empty())
      throw io::UserError(fmt::format("{}.{} cannot receive {}: walls of solver = \"liggghts\" stand. Use scheme = \"one-way\", or solver = \"dem\".",
                                      scene_.name, use.surface, use.receives.front()));
    for (const auto& field : use.sends)
      if (field != "force") throw io::UserError(fmt::format("{}.{} cannot send {}: it sends force.", scene_.name, use.surface, field));
    sent_.push_back(static_cast<std::size_t>(found - names.begin()));
  }
}

std::vector<protocol::Surface> Solver::start(const protocol::Run& run) {
  run_ = run;
  check_uses(run);
  scene_.gravity = dem::Vec3(run.gravity[0], run.gravity[1], run.gravity[2]);
  folder_ = run.results;
  folder_is_ours_ = folder_.empty();
  if (folder_is_ours_) folder_ = private_folder();
  fs::create_directories(folder_);
  if (!folder_is_ours_ && scene_.write_particles) pictures_ = std::make_unique<io::PvdSeries>(fmt::format("{}/{}.pvd", folder_, scene_.name));

  const dem::WallSet walls(scene_.walls);
  const auto particles = scene_.start_from ? dem::read_particles(scene_) : dem::insert_particles(scene_, walls);
  if (!team_) team_ = std::make_unique<Team>();
  engine_ = std::make_unique<Engine>(*team_);
  deck_ = write_deck(scene_, particles, walls, folder_);
  engine_->make(deck_);
  if (pictures_ && scene_.output_every > 0) write_particles(0);
  next_picture_ = scene_.output_every;

  std::vector<protocol::Surface> surfaces;
  for (const auto& use : run.uses)
    for (const auto& wall : scene_.walls)
      if (wall.name == use.surface) surfaces.push_back({wall.name, wall.mesh.surface()});
  return surfaces;
}

protocol::Advance Solver::advance(const protocol::Window& window, const std::vector<protocol::Field>&) {
  const auto begin = std::chrono::steady_clock::now();
  const auto steps = static_cast<std::uint64_t>(std::ceil(window.length / largest_step_ * (1 - 1e-12)));
  last_step_ = window.length / static_cast<double>(steps);
  const auto progress = engine_->advance(steps, last_step_);
  steps_ += steps;
  if (progress.particles != deck_.particles)
    throw std::runtime_error(fmt::format("{} of {} particles left the domain before t = {:.6g} s. Close the walls, shorten the step, or give {}.domain more room.",
                                         deck_.particles - progress.particles, deck_.particles, window.end_time(), scene_.name));

  protocol::Advance result;
  result.steps = steps;
  std::size_t lost = 0;
  auto forces = WallSums::on_vertices(deck_, progress.load, lost);
  couples_lost_ = std::max(couples_lost_, lost);
  for (const auto mesh : sent_) result.fields.push_back({deck_.meshes[mesh].name, "force", std::move(forces[mesh])});
  result.quantities = quantities(progress);
  seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();

  const bool last = window.end >= run_.end, due = scene_.output_every > 0 && window.end_time() >= next_picture_ * (1 - 1e-12);
  if (pictures_ && (last || due)) write_particles(window.end_time());
  while (scene_.output_every > 0 && next_picture_ <= window.end_time() * (1 + 1e-12)) next_picture_ += scene_.output_every;
  return result;
}

std::vector<std::pair<std::string, double>> Solver::quantities(const Progress& progress) const {
  std::vector<std::pair<std::string, double>> values;
  const auto* next = progress.load.data();
  for (const auto& mesh : deck_.meshes)
    for (const char* what : {"force", "torque"})
      for (const char axis : {'x', 'y', 'z'}) values.emplace_back(fmt::format("{}.{}.{}", mesh.name, what, axis), *next++);
  for (const auto& plane : deck_.planes) {
    for (const char axis : {'x', 'y', 'z'}) values.emplace_back(fmt::format("{}.force.{}", plane, axis), *next++);
    next += 3;
  }
  values.emplace_back("weight", progress.mass * scene_.gravity.norm());
  values.emplace_back("kinetic_energy", progress.kinetic_energy);
  values.emplace_back("particles", static_cast<double>(deck_.particles));
  return values;
}

void Solver::write_particles(double time) {
  std::vector<dem::Vec3> points;
  io::PointData radius{"radius", 1, {}}, velocity{"velocity", 3, {}}, id{"id", 1, {}}, speed{"speed", 1, {}};
  for (const auto& seen : engine_->gather()) {
    points.emplace_back(seen.position[0], seen.position[1], seen.position[2]);
    radius.values.push_back(seen.radius);
    velocity.values.insert(velocity.values.end(), seen.velocity, seen.velocity + 3);
    speed.values.push_back(std::hypot(seen.velocity[0], seen.velocity[1], seen.velocity[2]));
    id.values.push_back(seen.id - 1);  // LIGGGHTS counts from 1
  }
  const auto file = fmt::format("{}/{}_{:06}.vtp", folder_, scene_.name, std::llround(time / run_.tick));
  io::write_points(file, points, {radius, velocity, speed, id});
  pictures_->add(time, file);
}

std::vector<std::pair<std::string, double>> Solver::finish() {
  if (couples_lost_)
    fmt::print(stderr, "{} triangles are too thin to carry the couple they received; their force is exact\n", couples_lost_);
  const double work = static_cast<double>(deck_.particles) * static_cast<double>(steps_);
  return {{"seconds.steps", seconds_},
          {"steps", static_cast<double>(steps_)},
          {"step", last_step_},
          {"processes", static_cast<double>(team_->size())},
          {"particle_steps_per_second", seconds_ > 0 ? work / seconds_ : 0},
          {"couples_lost", static_cast<double>(couples_lost_)}};
}

std::string explain(const io::Table& root, const std::string& name) {
  const auto processes = root.table(name).integer("processes", 1, 65536, 1);
  const auto scene = read(root, name);
  const auto critical = dem::critical_step(scene);
  return fmt::format("LIGGGHTS on {} {}, {} particles\ncritical step {:.4g} s ({}), step at most {:.4g} s\nwalls stand; forces on their vertices are sent\n"
                     "as LIGGGHTS reads it (types: materials as particles, then as walls):\n{}",
                     processes, processes == 1 ? "process" : "processes", scene.particle_count(), critical.seconds, critical.reason,
                     dem::largest_step(scene, root.table(name)), laws_in_words(scene));
}

}  // namespace acopla::liggghts
