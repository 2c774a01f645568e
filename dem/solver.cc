#include "dem/solver.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "dem/feeding/insertion.h"
#include "dem/step.h"

namespace acopla::dem {

Solver::Solver(const io::Table& root, const std::string& name)
    : scene_(read_scene(root, name)), largest_step_(dem::largest_step(scene_, root.table(name))) {}

void Solver::check_uses(const protocol::Run& run) const {
  for (const auto& use : run.uses) {
    std::vector<std::string> meshes;
    for (const auto& wall : scene_.walls)
      if (!wall.is_plane) meshes.push_back(wall.name);
    if (std::find(meshes.begin(), meshes.end(), use.surface) == meshes.end()) {
      const auto nearest = io::nearest_word(use.surface, meshes);
      throw io::UserError(fmt::format("{} has no mesh wall {}.{}", scene_.name, use.surface,
                                      nearest ? fmt::format(" Did you mean {}?", *nearest) : " Planes have no vertices to couple."));
    }
    for (const auto& field : use.sends)
      if (field != "force") throw io::UserError(fmt::format("{}.{} cannot send {}: it sends force.", scene_.name, use.surface, field));
    for (const auto& field : use.receives)
      throw io::UserError(fmt::format("{}.{} cannot receive {}: its walls are at rest in this version.", scene_.name, use.surface, field));
  }
}

std::vector<protocol::Surface> Solver::start(const protocol::Run& run) {
  run_ = run;
  check_uses(run);
  scene_.gravity = Vec3(run.gravity[0], run.gravity[1], run.gravity[2]);
  WallSet walls(scene_.walls);
  for (const auto& wall : scene_.walls) {
    triangles_dropped_ += wall.mesh.dropped;
    if (wall.mesh.dropped)
      fmt::print(stderr, "wall {}: {} degenerate triangles were left out\n", wall.name, wall.mesh.dropped);
  }
  auto particles = insert_particles(scene_, walls);
  std::vector<protocol::Surface> surfaces;
  for (const auto& use : run.uses)
    for (const auto& wall : scene_.walls)
      if (wall.name == use.surface) {
        sent_.push_back(wall.name);
        surfaces.push_back({wall.name, wall.mesh.surface()});
      }
  for (std::size_t w = 0; w <= scene_.walls.size(); ++w) first_vertex_.push_back(walls.first_vertex(w));
  for (auto& wall : scene_.walls) wall.mesh = {};  // the engine has it now
  engine_ = make_engine(scene_, std::move(particles), std::move(walls));
  if (!run.results.empty() && scene_.write_particles) {
    std::filesystem::create_directories(run.results);
    pictures_ = std::make_unique<io::PvdSeries>(fmt::format("{}/{}.pvd", run.results, scene_.name));
    if (scene_.output_every > 0) write_particles(0);
    next_picture_ = scene_.output_every;
  }
  return surfaces;
}

protocol::Advance Solver::advance(const protocol::Window& window, const std::vector<protocol::Field>&) {
  const auto begin = std::chrono::steady_clock::now();
  const auto steps = static_cast<std::uint64_t>(std::ceil(window.length / largest_step_ * (1 - 1e-12)));
  const double step = window.length / static_cast<double>(steps);
  engine_->advance(steps, step);
  steps_ += steps;
  last_step_ = step;
  const auto& load = engine_->wall_load();
  couples_lost_ = std::max(couples_lost_, load.couples_lost);

  protocol::Advance result;
  result.steps = steps;
  for (const auto& name : sent_)
    for (std::size_t w = 0; w < scene_.walls.size(); ++w)
      if (scene_.walls[w].name == name)
        result.fields.push_back({name, "force",
                                 load.vertex_force[w]});
  result.quantities = quantities(step);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  seconds_ += seconds;
  last_rate_ = static_cast<double>(engine_->particles().size()) * static_cast<double>(steps) / seconds;
  if (pictures_) {
    const bool last = window.end >= run_.end;
    const bool due = scene_.output_every > 0 && window.end_time() >= next_picture_ * (1 - 1e-12);
    if (last || due) write_particles(window.end_time());
    while (scene_.output_every > 0 && next_picture_ <= window.end_time() * (1 + 1e-12)) next_picture_ += scene_.output_every;
  }
  return result;
}

std::vector<std::pair<std::string, double>> Solver::quantities(double step) const {
  std::vector<std::pair<std::string, double>> values;
  const auto& load = engine_->wall_load();
  for (std::size_t w = 0; w < scene_.walls.size(); ++w)
    for (int d = 0; d < scene_.dimension; ++d)
      values.emplace_back(fmt::format("{}.force.{}", scene_.walls[w].name, "xyz"[d]), load.walls[w].force[d]);
  values.emplace_back("weight", engine_->mass() * scene_.gravity.norm());
  values.emplace_back("kinetic_energy", engine_->kinetic_energy());
  values.emplace_back("particles", static_cast<double>(engine_->particles().size()));
  values.emplace_back("contacts", static_cast<double>(engine_->contact_count()));
  values.emplace_back("step_ratio", engine_->step_ratio(step).value);
  values.emplace_back("overlap.max", engine_->worst_overlap());
  return values;
}

void Solver::write_particles(double time) {
  const auto& p = engine_->particles();
  std::vector<Vec3> points;
  io::PointData radius{"radius", 1, {}}, velocity{"velocity", 3, {}}, id{"id", 1, {}}, speed{"speed", 1, {}};
  for (std::size_t i = 0; i < p.size(); ++i) {
    points.push_back(p.position[i].vector());
    radius.values.push_back(p.position[i].w);
    for (int d = 0; d < 3; ++d) velocity.values.push_back(p.velocity_of(i)[d]);
    speed.values.push_back(p.velocity_of(i).norm());
    id.values.push_back(p.id[i]);
  }
  const auto file = fmt::format("{}/{}_{:06}.vtp", run_.results, scene_.name, std::llround(time / run_.tick));
  io::write_points(file, points, {radius, velocity, speed, id});
  pictures_->add(time, file);
}

std::vector<std::pair<std::string, double>> Solver::finish() {
  if (couples_lost_)
    fmt::print(stderr, "{} triangles are too thin to carry the rolling couple they received; their force is exact\n", couples_lost_);
  const double work = static_cast<double>(engine_->particles().size()) * static_cast<double>(steps_);
  return {{"seconds.steps", seconds_},
          {"steps", static_cast<double>(steps_)},
          {"step", last_step_},
          {"particle_steps_per_second", seconds_ > 0 ? work / seconds_ : 0},
          {"particle_steps_per_second.last", last_rate_},  // of the last window: a settled bed
          {"list_rebuilds", static_cast<double>(engine_->rebuilds())},
          {"couples_lost", static_cast<double>(couples_lost_)},
          {"triangles_dropped", static_cast<double>(triangles_dropped_)}};
}

}  // namespace acopla::dem
