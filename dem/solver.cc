#include "dem/solver.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "dem/checkpoint.h"
#include "dem/feeding/insertion.h"
#include "dem/start_from.h"
#include "dem/step.h"

namespace acopla::dem {

Solver::Solver(const io::Table& root, const std::string& name)
    : scene_(read_scene(root, name)), largest_step_(dem::largest_step(scene_, root.table(name))), step_watch_(scene_) {
  // A scene at the default step does not pay for this.
  if (watches_energy(scene_, largest_step_)) scene_.keeps_ledger = true;
}

std::size_t Solver::wall_of(const std::string& surface) const {
  std::vector<std::string> names;
  for (std::size_t w = 0; w < scene_.walls.size(); ++w) {
    if (scene_.walls[w].is_plane) continue;
    if (scene_.walls[w].name == surface) return w;
    names.push_back(scene_.walls[w].name);
  }
  const auto nearest = io::nearest_word(surface, names);
  throw io::UserError(fmt::format("{} has no wall {} with vertices.{}", scene_.name, surface,
                                  nearest ? fmt::format(" Did you mean {}?", *nearest) : " Planes have none to couple."));
}

void Solver::check_uses(const protocol::Run& run) {
  for (const auto& use : run.uses) {
    const auto wall = wall_of(use.surface);
    for (const auto& field : use.sends)
      if (field != "force" && field != "displacement")
        throw io::UserError(fmt::format("{}.{} cannot send {}: it sends force and displacement.", scene_.name, use.surface, field));
    const auto sends = [&](const char* field) { return std::find(use.sends.begin(), use.sends.end(), field) != use.sends.end(); };
    if (sends("force")) sent_.push_back(wall);
    if (sends("displacement")) followed_.push_back(wall);
    if (use.receives.empty()) continue;
    for (const auto& field : use.receives)
      if (field != "displacement" && field != "velocity" && field != "end_displacement" && field != "end_velocity")
        throw io::UserError(fmt::format("{}.{} cannot receive {}: it receives displacement and velocity, at a window's start and end.", scene_.name,
                                        use.surface, field));
    if (scene_.walls[wall].motion.moves())
      throw io::UserError(fmt::format("{}.{} is moved by the coupled solver and has a motion of its own. Remove its motion.", scene_.name, use.surface));
    scene_.walls[wall].motion = Motion::prescribed();
    received_.push_back(wall);
  }
}

std::vector<protocol::Surface> Solver::start(const protocol::Run& run) {
  run_ = run;
  check_uses(run);
  scene_.gravity = Vec3(run.gravity[0], run.gravity[1], run.gravity[2]);
  for (const auto& wall : scene_.walls) {
    triangles_dropped_ += wall.mesh.dropped;
    if (wall.mesh.dropped)
      fmt::print(stderr, "wall {}: {} degenerate triangles were left out\n", wall.name, wall.mesh.dropped);
  }
  WallSet walls(scene_.walls);
  // Forces on vertices are summed only for walls that somebody wants them of.
  for (const auto wall : sent_) walls.send(wall);
  std::vector<protocol::Surface> surfaces;
  for (const auto& use : run.uses) surfaces.push_back({use.surface, walls.surface(wall_of(use.surface)), {}, {}, {}});
  for (const auto wall : followed_) places_.push_back(walls.surface(wall).points);
  open_pictures();
  if (run.resumes) resuming_ = std::move(walls);
  else begin(std::move(walls));
  // In a state that a scene goes on from walls have moved already.
  if (!run.resumes)
    for (std::size_t k = 0; k < followed_.size(); ++k)
      for (auto& surface : surfaces)
        if (surface.name == scene_.walls[followed_[k]].name) surface.displacement = displacement(k);
  return surfaces;
}

void Solver::begin(WallSet walls) {
  auto particles = first_particles(walls);
  const auto by_itself = [](const Wall& wall) { return wall.motion.moves() && wall.motion.kind() != Motion::Kind::prescribed; };
  const bool apart = scene_.settling && std::any_of(scene_.walls.begin(), scene_.walls.end(), by_itself);
  if (apart) particles = settled_between_standing_walls(std::move(particles));
  make(std::move(particles), std::move(walls));
  if (scene_.settling && !apart) settle(*engine_);
  if (scene_.start_from && scene_.start_from->whole) read_state(scene_, *engine_, *traffic_);
  if (pictures_ && scene_.output_every > 0) {
    write_particles(0);
    write_moving_walls(0);
  }
  next_picture_ = scene_.output_every;
}

void Solver::make(Particles particles, WallSet walls) {
  for (auto& wall : scene_.walls) wall.mesh = {};  // the engine has it now
  engine_ = make_engine(scene_, std::move(particles), std::move(walls));
  traffic_ = std::make_unique<Traffic>(scene_);
}

void Solver::open_pictures() {
  if (run_.results.empty() || !scene_.write_particles) return;
  std::filesystem::create_directories(run_.results);
  pictures_ = std::make_unique<io::PvdSeries>(fmt::format("{}/{}.pvd", run_.results, scene_.name));
  for (std::size_t w = 0; w < scene_.walls.size(); ++w)
    if (scene_.walls[w].motion.moves() && !scene_.walls[w].is_plane)
      wall_pictures_.emplace_back(w, io::PvdSeries(fmt::format("{}/{}_{}.pvd", run_.results, scene_.name, scene_.walls[w].name)));
}

Particles Solver::first_particles(const WallSet& walls) const {
  if (scene_.start_from) return read_particles(scene_);
  return insert_particles(scene_, walls);
}

// Walls that move by themselves must not do so while the particles settle: those settle in a scene of their own, and begin here without
// the springs of their contacts.
Particles Solver::settled_between_standing_walls(Particles particles) const {
  auto scene = scene_;
  for (auto& wall : scene.walls) wall.motion = Motion();
  scene.keeps_ledger = false;
  const auto engine = make_engine(scene, std::move(particles));
  settle(*engine);
  return engine->particles();
}

void Solver::settle(Engine& engine) const {
  const auto& settling = *scene_.settling;
  const double gravity = scene_.gravity.norm();
  double scale = 0;  // Σ m g r
  for (std::size_t i = 0; i < engine.particles().size(); ++i) scale += engine.particles().mass_of(i) * gravity * engine.particles().radius_of(i);
  // At rest twice in a row, a fall of one radius apart: nobody may be caught at the top of a flight.
  const double pause = std::sqrt(2 * scene_.largest_radius() / gravity);
  const auto steps = static_cast<std::uint64_t>(std::max(1.0, std::ceil(pause / largest_step_)));
  for (int at_rest = 0; at_rest < 2;) {
    engine.advance(steps, largest_step_);
    at_rest = engine.kinetic_energy() < settling.kinetic_energy * scale ? at_rest + 1 : 0;
    if (engine.time() > settling.limit && at_rest < 2)
      throw io::UserError(settling.where, fmt::format("the particles have not settled in {:.4g} s: their kinetic energy is {:.3g} of Σ m g r, and "
                                                      "kinetic_energy asks for {:.3g}. Raise limit, or add damping or rolling resistance.",
                                                      settling.limit, engine.kinetic_energy() / scale, settling.kinetic_energy));
  }
  engine.restart_clock();
}

protocol::Advance Solver::advance(const protocol::Window& window, const std::vector<protocol::Field>& received) {
  const auto begin = std::chrono::steady_clock::now();
  const auto steps = static_cast<std::uint64_t>(std::ceil(window.length / largest_step_ * (1 - 1e-12)));
  const double step = window.length / static_cast<double>(steps);
  prescribe(window, received);
  step_through(steps, step);
  steps_ += steps;
  last_step_ = step;
  couples_lost_ = std::max(couples_lost_, load_.couples_lost);
  step_watch_.look(*engine_, step, steps_);

  protocol::Advance result;
  result.steps = steps;
  for (const auto wall : sent_) result.fields.push_back({scene_.walls[wall].name, "force", load_.vertex_force[wall]});
  for (std::size_t k = 0; k < followed_.size(); ++k) result.fields.push_back({scene_.walls[followed_[k]].name, "displacement", displacement(k)});
  if (window.estimate)
    for (const auto wall : received_)
      if (std::find(sent_.begin(), sent_.end(), wall) != sent_.end()) {
        auto hold = engine_->hold_on(wall);
        result.fields.push_back({scene_.walls[wall].name, "stiffness", std::move(hold.stiffness)});
        result.fields.push_back({scene_.walls[wall].name, "dashpot", std::move(hold.dashpot)});
        result.fields.push_back({scene_.walls[wall].name, "mass", std::move(hold.mass)});
      }
  result.quantities = quantities(step);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  seconds_ += seconds;
  last_rate_ = static_cast<double>(engine_->particles().size()) * static_cast<double>(steps) / seconds;
  write_output(window);
  return result;
}

/// How far a followed wall has moved from where the case puts it.
std::vector<Vec3> Solver::displacement(std::size_t followed) const {
  auto moved = engine_->walls().positions(followed_[followed]);
  for (std::size_t v = 0; v < moved.size(); ++v) moved[v] -= places_[followed][v];
  return moved;
}

void Solver::prescribe(const protocol::Window& window, const std::vector<protocol::Field>& received) {
  for (const auto wall : received_) {
    const auto given = [&](const char* name) -> const std::vector<Vec3>* {
      for (const auto& field : received)
        if (field.surface == scene_.walls[wall].name && field.name == name) return &field.values;
      return nullptr;
    };
    const auto* const displacement = given("displacement");
    if (!displacement) continue;  // nothing was said: the wall stays
    const std::vector<Vec3> still(displacement->size(), Vec3::Zero());
    const auto or_still = [&](const std::vector<Vec3>* velocity) { return std::span<const Vec3>(velocity ? *velocity : still); };
    const auto* const end = given("end_displacement");
    if (!end) engine_->walls().prescribe(wall, *displacement, or_still(given("velocity")), engine_->time());
    else
      engine_->walls().prescribe(wall, {*displacement, or_still(given("velocity"))}, {*end, or_still(given("end_velocity"))}, engine_->time(),
                                 window.length);
  }
}

// All steps of a window, with the inlets and outlets visited in between; load_ becomes the mean over all of them.
void Solver::step_through(std::uint64_t steps, double step) {
  if (traffic_->none()) {
    engine_->advance(steps, step);
    load_ = engine_->wall_load();
    return;
  }
  const auto pause = std::min(steps, traffic_->steps_between(step));
  WallLoad sum;
  for (std::uint64_t done = 0; done < steps;) {
    const auto some = std::min(pause, steps - done);
    traffic_->visit(*engine_);
    engine_->advance(some, step);
    sum.add(engine_->wall_load(), static_cast<double>(some) / static_cast<double>(steps));
    done += some;
  }
  load_ = std::move(sum);
}

std::vector<std::pair<std::string, double>> Solver::quantities(double) {
  std::vector<std::pair<std::string, double>> values;
  for (std::size_t w = 0; w < scene_.walls.size(); ++w) {
    const auto& wall = scene_.walls[w];
    for (int d = 0; d < scene_.dimension; ++d) values.emplace_back(fmt::format("{}.force.{}", wall.name, "xyz"[d]), load_.walls[w].force[d]);
    for (int d = scene_.dimension == 2 ? 2 : 0; d < 3; ++d)
      values.emplace_back(fmt::format("{}.torque.{}", wall.name, "xyz"[d]), load_.walls[w].torque[d]);
    if (wall.motion.kind() == Motion::Kind::servo) values.emplace_back(wall.name + ".travel", engine_->walls().servo_travel(w));
  }
  values.emplace_back("weight", engine_->mass() * scene_.gravity.norm());
  values.emplace_back("kinetic_energy", engine_->kinetic_energy());
  values.emplace_back("particles", static_cast<double>(engine_->particles().size()));
  values.emplace_back("contacts", static_cast<double>(engine_->contact_count()));
  values.emplace_back("step_ratio", step_watch_.ratio());
  values.emplace_back("overlap.max", engine_->worst_overlap());
  traffic_->quantities(values);
  if (engine_->keeps_ledger()) {
    const auto e = engine_->energy();
    for (const auto& [name, value] : std::initializer_list<std::pair<const char*, double>>{
             {"kinetic", e.kinetic}, {"gravity", e.gravity}, {"normal", e.normal}, {"tangential", e.tangential}, {"rolling", e.rolling},
             {"lost.normal", e.lost_normal}, {"lost.sliding", e.lost_sliding}, {"lost.rolling", e.lost_rolling}, {"lost.damping", e.lost_damping},
             {"wall_work", e.wall_work}, {"added", e.added}, {"drift", e.drift}, {"relative_drift", e.relative_drift}})
      values.emplace_back(fmt::format("energy.{}", name), value);
  }
  return values;
}

void Solver::save() {
  io::StateWriter writer((saved_.clear(), saved_));
  writer("engine", *engine_);
  writer("traffic", *traffic_);
  state(writer);
}

void Solver::restore() {
  if (saved_.empty()) throw std::logic_error("restore without save");
  io::StateReader reader(saved_);
  reader("engine", *engine_);
  reader("traffic", *traffic_);
  state(reader);
  reader.finish();
}

void Solver::checkpoint(const std::string& folder) { write_state(fmt::format("{}/{}.h5", folder, scene_.name)); }

void Solver::write_state(const std::string& path) {
  write_checkpoint(path, scene_, *engine_, *traffic_, [this](io::StateWriter& writer) { state(writer); });
}

void Solver::resume(const std::string& folder) {
  if (!resuming_) throw std::logic_error("resume of a run that has begun");
  scene_.start_from = StartFrom{fmt::format("{}/{}.h5", folder, scene_.name), {}, true, {}};
  make(read_particles(scene_), std::move(*resuming_));
  resuming_.reset();
  read_state(scene_, *engine_, *traffic_, [this](io::StateReader& reader) { state(reader); });
  if (pictures_) pictures_->keep_until(engine_->time());
  for (auto& [wall, series] : wall_pictures_) series.keep_until(engine_->time());
}

void Solver::write_output(const protocol::Window& window) {
  const bool last = window.end >= run_.end;
  const bool due = scene_.output_every > 0 && window.end_time() >= next_picture_ * (1 - 1e-12);
  if (last || due) {
    if (pictures_) {
      write_particles(window.end_time());
      write_moving_walls(window.end_time());
    }
    if (scene_.write_checkpoint && !run_.results.empty())
      write_state(fmt::format("{}/checkpoint.h5", run_.results));
  }
  while (scene_.output_every > 0 && next_picture_ <= window.end_time() * (1 + 1e-12)) next_picture_ += scene_.output_every;
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

void Solver::write_moving_walls(double time) {
  for (auto& [wall, series] : wall_pictures_) {
    auto surface = engine_->walls().surface(wall);
    surface.points = engine_->walls().positions(wall);
    const auto file = fmt::format("{}/{}_{}_{:06}.vtp", run_.results, scene_.name, scene_.walls[wall].name, std::llround(time / run_.tick));
    io::write_surface(file, surface, {});
    series.add(time, file);
  }
}

std::vector<std::pair<std::string, double>> Solver::finish() {
  for (const auto& warning : traffic_->warnings()) fmt::print(stderr, "{}\n", warning);
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
