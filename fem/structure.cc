#include "fem/structure.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>

#include "fem/cholesky.h"
#include "fem/distributed/distributed_matrices.h"
#include "fem/finite_strain.h"
#include "fem/interface.h"
#include "fem/large_motion.h"
#include "fem/model.h"
#include "fem/modes.h"
#include "fem/picture.h"
#include "fem/statics.h"
#include "fem/stress.h"
#include "io/checkpoint.h"
#include "io/vtk.h"

namespace acopla::fem {
namespace {

class Stopwatch {
 public:
  double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace

struct Structure::Body {
  Model model;
  std::optional<BlockMatrix> stiffness;  // and the mass: of this process alone, not of a team
  std::optional<MassMatrix> mass;
  std::shared_ptr<const Matrices> matrices;  // not of large displacements
  Stress stress;
  std::optional<Statics> statics;
  std::optional<LargeDisplacements> large;  // instead, and to start a motion from
  // Of a structure in motion one of the next.
  std::optional<Dynamics> dynamics;
  std::optional<LargeMotion> large_motion;

  Body(const Settings& settings, const Vec3& gravity, Team* team)
      : model(settings, gravity),
        stress(model.mesh, model.materials, settings.formulation) {
    const bool is_large = settings.formulation.large;
    if (team) {
      matrices = std::make_shared<DistributedMatrices>(*team, settings, model, settings.motion.has_value());
    } else {
      stiffness.emplace(stiffness_of(settings, model));
      if (settings.motion) mass.emplace(assemble_mass(model.mesh, model.materials, settings.formulation, stiffness->pattern()));
      matrices = std::make_shared<LocalMatrices>(model.mesh, model.supports.fixed(), *stiffness, mass ? &*mass : nullptr);
    }
    if (is_large && (!settings.motion || settings.motion->from_equilibrium))
      large.emplace(model.mesh, model.materials, model.supports.fixed(), settings.solver,
                    settings.formulation);
    if (!settings.motion) {
      if (!is_large) statics.emplace(matrices, model.supports.fixed(), settings.solver);
      return;
    }
    if (is_large)
      large_motion.emplace(model.mesh, model.materials, *mass, settings.motion->damping, model.supports,
                           model.loads, settings.solver, settings.formulation);
    else
      dynamics.emplace(model.mesh, matrices, settings.motion->damping, model.supports, model.loads,
                       settings.motion->scheme, settings.solver);
  }
  bool moves() const { return dynamics || large_motion; }
  Energy energy(const Motion& motion) const { return dynamics ? dynamics->energy(motion) : large_motion->energy(motion); }
};

/// A surface that the coupling uses.
struct Structure::Coupled {
  protocol::Run::Use use;
  Interface interface;
};

Structure::Structure(Settings settings, Team* team) : settings_(std::move(settings)), team_(team) {
  if (team_ || settings_.processes > 1) refuse_unshared(settings_);
}
Structure::~Structure() = default;

protocol::Introduction Structure::introduce() const {
  return {.solver = "fem", .dimension = settings_.dimension, .capabilities = {"save", "checkpoint"}};
}

namespace {

void check_fields(const Settings& settings, const protocol::Run::Use& use) {
  const auto refuse = [&](const std::string& field, const std::string& verb,
                          const std::string& known) {
    throw io::UserError(settings.table.location(),
                        fmt::format("{}.{} cannot {} \"{}\": a structure {}s {}.", settings.name,
                                    use.surface, verb, field, verb, known));
  };
  for (const auto& field : use.receives)
    if (field != "force") refuse(field, "receive", "\"force\"");
  for (const auto& field : use.sends)
    if (field != "displacement" && field != "velocity")
      refuse(field, "send", "\"displacement\" and \"velocity\"");
}

Interface make_interface(const Settings& settings, const Mesh& mesh, const std::string& surface) {
  try {
    return {mesh, surface};
  } catch (const std::invalid_argument& error) {
    throw io::UserError(settings.table.location("mesh"),
                        fmt::format("surface {}.{} {}", settings.name, surface, error.what()));
  }
}

int steps_in(double length, const std::optional<double>& longest) {
  return longest ? std::max(1, static_cast<int>(std::ceil(length / *longest * (1 - 1e-9)))) : 1;
}

}  // namespace

namespace {

/// A mesh drawn in millimetres is a thousand times too large.
std::string doubtful_size(const Mesh& mesh) {
  if (mesh.extent() < 1000) return {};
  return fmt::format("the mesh is {:.4g} m large. Lengths are metres: was it drawn in millimetres?",
                     mesh.extent());
}

}  // namespace

std::vector<protocol::Surface> Structure::start(const protocol::Run& run) {
  const Stopwatch setup;
  run_ = run;
  for (const auto& use : run.uses) check_fields(settings_, use);
  if (!run.uses.empty() && settings_.dimension == 2 && settings_.formulation.thickness != 1)
    settings_.table.fail("thickness",
                         "must be 1 in a coupling: forces between participants in 2D are those of "
                         "a metre of depth.");
  body_ = std::make_unique<Body>(settings_, Vec3(run.gravity[0], run.gravity[1], run.gravity[2]), team_);
  if (const auto doubt = doubtful_size(body_->model.mesh); !doubt.empty())
    fmt::print(stderr, "{}: warning: {}.mesh: {}\n", settings_.table.location("mesh").text(), settings_.name, doubt);
  std::vector<protocol::Surface> surfaces;
  for (const auto& use : run.uses) {
    coupled_.push_back({use, make_interface(settings_, body_->model.mesh, use.surface)});
    surfaces.push_back({use.surface, coupled_.back().interface.surface()});
  }
  seconds_.setup = setup.seconds();
  const Stopwatch factor;
  if (settings_.frequencies > 0) check_frequencies();
  find_probes();
  if (body_->statics)
    body_->statics->prepare();
  else if (body_->moves())
    begin_motion();
  seconds_.factor = factor.seconds();
  for (std::size_t k = 0; k < surfaces.size(); ++k) {
    const auto& [use, interface] = coupled_[k];
    if (!run.wants_mass || !body_->moves() || use.sends.empty()) continue;
    const auto& held = body_->model.supports.fixed();
    const auto sudden_masses = body_->matrices->sudden(interface.nodes());
    for (std::size_t i = 0; i < sudden_masses.size(); ++i) {
      Vec3 mass = Vec3::Zero();
      const auto node = interface.nodes()[i];
      const double sudden = sudden_masses[i];
      for (int d = 0; d < settings_.dimension; ++d)
        if (!held[static_cast<std::size_t>(settings_.dimension) * node + static_cast<std::size_t>(d)]) mass[d] = sudden;
      surfaces[k].mass.push_back(mass);
    }
  }
  // Where it does not begin at rest in its reference position: its weight bends it, or its supports move.
  for (auto& field : fields())
    for (auto& surface : surfaces)
      if (surface.name == field.surface && std::any_of(field.values.begin(), field.values.end(), [](const Vec3& v) { return v != Vec3::Zero(); }))
        (field.name == "displacement" ? surface.displacement : surface.velocity) = std::move(field.values);
  return surfaces;
}

void Structure::find_probes() {
  const auto& mesh = body_->model.mesh;
  for (const auto& probe : settings_.probes) {
    Probed probed{probe.name, mesh.nearest_node(probe.at), {}};
    const double distance = (mesh.points()[probed.node] - probe.at).norm();
    if (distance > 0.1 * mesh.extent())
      probe.table.fail(
          "at", fmt::format("is {:.3g} m away from the nearest node of the mesh.", distance));
    for (std::size_t c = 0; probe.stress && c < mesh.cells(); ++c) {
      const auto nodes = mesh.cell(c);
      if (std::find(nodes.begin(), nodes.end(), probed.node) != nodes.end())
        probed.cells.push_back(c);
    }
    probed_.push_back(std::move(probed));
  }
  if (!settings_.reactions) return;
  // A node of two supports counts for the first that holds it.
  std::vector<char> counted(mesh.unknowns(), 0);
  const auto dimension = static_cast<std::size_t>(mesh.dimension());
  for (const auto& support : settings_.supports) {
    const auto& name = support.table.name();
    supported_.push_back({name.substr(name.rfind('.') + 1), {}});
    for (const auto node : nodes_of(support.part.faces(mesh)))
      for (std::size_t d = 0; d < dimension; ++d) {
        const auto unknown = dimension * node + d;
        if (!support.directions[d] || counted[unknown]++) continue;
        supported_.back().second.push_back(unknown);
      }
  }
}

void Structure::add_probes(std::vector<std::pair<std::string, double>>& result) const {
  const int dimension = settings_.dimension;
  static constexpr const char* voigt[] = {"xx", "yy", "zz", "yz", "xz", "xy"};
  const auto add_vector = [&](const std::string& name, const Vector& nodal, std::uint32_t node) {
    const Vec3 value = value_at(nodal, node, dimension);
    for (int d = 0; d < dimension; ++d) result.emplace_back(name + "xyz"[d], value[d]);
  };
  for (const auto& [name, node, cells] : probed_) {
    add_vector(name + ".displacement.", state_.motion.displacement, node);
    if (settings_.motion) add_vector(name + ".velocity.", state_.motion.velocity, node);
    if (cells.empty()) continue;
    const auto stress = body_->stress.at_node(node, cells, state_.motion.displacement);
    for (int i = 0; i < 6; ++i)
      if (dimension == 3 || i < 3 || i == 5)
        result.emplace_back(name + ".stress." + voigt[i], stress[i]);
    const Vec3 principals = principal(stress);
    for (int i = 0; i < 3; ++i)
      result.emplace_back(fmt::format("{}.principal.{}", name, i + 1), principals[i]);
    result.emplace_back(name + ".von_mises", von_mises(stress));
  }
}

void Structure::add_reactions(const Vector& reaction,
                              std::vector<std::pair<std::string, double>>& result) const {
  const auto dimension = static_cast<std::size_t>(settings_.dimension);
  for (const auto& [name, unknowns] : supported_) {
    Vec3 sum = Vec3::Zero();
    for (const auto unknown : unknowns)
      sum[static_cast<int>(unknown % dimension)] += reaction[static_cast<Eigen::Index>(unknown)];
    for (std::size_t d = 0; d < dimension; ++d)
      result.emplace_back(name + ".reaction." + "xyz"[d], sum[static_cast<int>(d)]);
  }
}

/// axis · Σ (x − about) × F; where displacements are large, of the places at the window's end.
void Structure::add_torques(const Vector& reaction_forces, const Vector& loads, std::vector<std::pair<std::string, double>>& result) const {
  const auto& mesh = body_->model.mesh;
  for (const auto& [name, about, axis] : settings_.torques) {
    double reaction = 0, load = 0;
    for (std::size_t n = 0; n < mesh.nodes(); ++n) {
      Vec3 arm = mesh.points()[n] - about;
      if (settings_.formulation.large) arm += value_at(state_.motion.displacement, n, mesh.dimension());
      const Vec3 turn = axis.cross(arm);  // axis · (arm × F) = (axis × arm) · F
      reaction += turn.dot(value_at(reaction_forces, n, mesh.dimension()));
      load += turn.dot(value_at(loads, n, mesh.dimension()));
    }
    result.emplace_back(name + ".torque.reaction", reaction);
    result.emplace_back(name + ".torque.load", load);
  }
}

/// Before hours of a run that they would end in.
void Structure::check_frequencies() const {
  const auto output = settings_.table.table("output");
  const auto& fixed = body_->model.supports.fixed();
  Fixed held = fixed;
  for (const auto& foundation : settings_.foundations) mark(foundation, body_->model.mesh, held);
  const auto motions = free_motions(body_->model.mesh, held);
  if (!motions.empty())
    output.fail("frequencies",
                "are asked of a structure that is free to " + motions + ". Fix more.");
  const auto free = static_cast<std::size_t>(std::count(fixed.begin(), fixed.end(), 0));
  if (4 * settings_.frequencies > free)
    output.fail(
        "frequencies",
        fmt::format("asks for more than a quarter of the {} free unknowns. Refine the mesh.",
                    free));
}

/// Equilibrium under weight and the loads at t = 0, or rest; and the factor of the first step.
void Structure::begin_motion() {
  const auto& [mesh, materials, supports, loads] = body_->model;
  const auto prepare = [&] {
    if (!body_->dynamics) return;  // large displacements factor in every step
    const double window = run_.time(run_.window);
    body_->dynamics->prepare(window / steps_in(window, settings_.motion->step));
  };
  if (run_.resumes) return prepare();
  auto& motion = state_.motion;
  motion.displacement = motion.velocity = mesh.zero();
  supports.place(0, motion.displacement);
  supports.drive(0, motion.velocity);
  const auto load = loads.at(0);
  const bool strained = motion.displacement.squaredNorm() > 0;
  if (settings_.motion->from_equilibrium && (load.squaredNorm() > 0 || strained)) {
    require_supported(
        settings_, mesh, supports.fixed(), "start",
        "There is no equilibrium under its weight and loads: use start = \"rest\", or fix more.");
    if (body_->large) {
      motion.displacement = body_->large->solve(load, motion.displacement).displacement;
      body_->large.reset();  // a motion does without
    } else {
      Statics statics(body_->matrices, supports.fixed(), settings_.solver);
      statics.prepare();
      motion.displacement = statics.solve(load, {}, motion.displacement).displacement;
    }
  }
  prepare();  // once the factor of the statics is gone
  if (settings_.energy) {
    state_.passed = body_->energy(motion);
    start_energy_ = state_.passed.kinetic + state_.passed.strain;
  }
}

Vector Structure::received_load(const std::vector<protocol::Field>& received) const {
  Vector load = body_->model.mesh.zero();
  for (const auto& field : received) {
    const auto found = std::find_if(coupled_.begin(), coupled_.end(), [&](const Coupled& c) {
      return c.use.surface == field.surface;
    });
    if (field.name != "force" || found == coupled_.end())
      throw std::runtime_error(
          fmt::format("the structure was sent \"{}\" on \"{}\"; it takes "
                      "\"force\" on the surfaces it offered",
                      field.name, field.surface));
    try {
      found->interface.add_forces(field.values, load);
    } catch (const std::invalid_argument& error) {
      throw std::runtime_error(fmt::format("surface \"{}\" {}", field.surface, error.what()));
    }
  }
  return load;
}

std::vector<protocol::Field> Structure::fields() const {
  std::vector<protocol::Field> result;
  const auto& [displacement, velocity, acceleration, force, time] = state_.motion;
  for (const auto& [use, interface] : coupled_)
    for (const auto& name : use.sends) {
      const auto& nodal = name == "displacement" ? displacement : velocity;
      auto values = nodal.size() > 0 ? interface.values(nodal)
                                     : std::vector<Vec3>(interface.nodes().size(), Vec3::Zero());
      result.push_back({use.surface, name, std::move(values)});
    }
  return result;
}

Structure::Response Structure::equilibrate(const protocol::Window& window, const Vector& force) {
  const auto& [mesh, materials, supports, loads] = body_->model;
  const double end = window.end_time();
  const Vector load = force + loads.at(end);
  Vector prescribed;
  if (supports.moving()) {
    prescribed = mesh.zero();
    supports.place(end, prescribed);
  }
  if (body_->large) {
    auto& motion = state_.motion;
    if (motion.displacement.size() > 0)
      body_->large->restart_from(motion.displacement, motion.force);
    const auto before = body_->large->iterations();
    auto solution = body_->large->solve(load, prescribed);
    worst_residual_ = std::max(worst_residual_, solution.residual);
    motion.displacement = std::move(solution.displacement);
    motion.force = load;
    return {std::move(solution.reaction), load,
            body_->large->iterations() - before};
  }
  auto solution = body_->statics->solve(load, state_.motion.displacement, prescribed);
  worst_residual_ = std::max(worst_residual_, solution.residual);
  state_.motion.displacement = std::move(solution.displacement);
  return {std::move(solution.reaction), load, 1};
}

Structure::Response Structure::move(const protocol::Window& window, const Vector& force) {
  const auto& [mesh, materials, supports, loads] = body_->model;
  const int steps = steps_in(window.length, settings_.motion->step);
  auto& passed = state_.passed;
  state_.motion.time = window.start_time;
  Energy energy;
  auto* wanted = settings_.energy ? &energy : nullptr;
  Response response{
      body_->dynamics ? body_->dynamics->advance(state_.motion, force, window.length, steps, wanted)
                      : body_->large_motion->advance(state_.motion, force, window.length, steps, wanted),
      force + loads.mean(window.start_time, window.end_time()),
      static_cast<std::uint64_t>(steps)};
  passed = {energy.kinetic, energy.strain, passed.work + energy.work,
            passed.support_work + energy.support_work, passed.damping + energy.damping};
  return response;
}

protocol::Advance Structure::advance(const protocol::Window& window,
                                     const std::vector<protocol::Field>& received) {
  if (state_.due) draw();
  const Stopwatch solve;
  const auto force = received_load(received);
  const auto response = body_->moves() ? move(window, force) : equilibrate(window, force);
  state_.motion.time = window.end_time();
  state_.due = is_due(window);
  state_.drawn = false;
  protocol::Advance result{fields(), quantities(response), response.steps};
  seconds_.solve += solve.seconds();
  return result;
}

std::vector<std::pair<std::string, double>> Structure::quantities(const Response& response) const {
  const int dimension = settings_.dimension;
  std::vector<std::pair<std::string, double>> result;
  Vector with_foundations;
  if (!settings_.foundations.empty()) with_foundations = response.reaction;
  for (const auto& foundation : settings_.foundations)
    add_forces(foundation, body_->model.mesh, settings_.formulation, state_.motion.displacement, with_foundations);
  const Vector& held = settings_.foundations.empty() ? response.reaction : with_foundations;
  const Vec3 reaction = total(held, dimension), load = total(response.load, dimension);
  for (int d = 0; d < dimension; ++d)
    result.emplace_back(std::string("reaction.") + "xyz"[d], reaction[d]);
  for (int d = 0; d < dimension; ++d)
    result.emplace_back(std::string("load.") + "xyz"[d], load[d]);
  result.emplace_back("displacement.max", largest_length(state_.motion.displacement, dimension));
  if (settings_.motion)
    result.emplace_back("velocity.max", largest_length(state_.motion.velocity, dimension));
  if (settings_.von_mises)
    result.emplace_back("von_mises.max", body_->stress.peak(state_.motion.displacement).value);
  add_reactions(response.reaction, result);
  add_torques(held, response.load, result);
  add_probes(result);
  if (settings_.energy) {
    const auto& [kinetic, strain, work, support_work, damping] = state_.passed;
    result.emplace_back("energy.kinetic", kinetic);
    result.emplace_back("energy.strain", strain);
    result.emplace_back("energy.work", work + support_work);
    result.emplace_back("energy.damping", damping);
    result.emplace_back("energy.error",
                        kinetic + strain - start_energy_ - work - support_work + damping);
  }
  return result;
}

bool Structure::is_due(const protocol::Window& window) const {
  if (!settings_.every) return false;
  // Windows end on ticks; half a tick absorbs the rounding of time / every.
  const auto pictures = [&](double time) {
    return std::floor((time + 0.5 * run_.tick) / *settings_.every);
  };
  return pictures(window.end_time()) > pictures(window.start_time);
}

void Structure::draw() {
  state_.due = false;
  state_.drawn = true;
  if (run_.results.empty() || !(settings_.vtu || settings_.hdf5)) return;
  const auto folder = std::filesystem::path(run_.results);
  std::filesystem::create_directories(folder);
  ++pictures_;
  if (settings_.hdf5) write_nodal((folder / (settings_.name + ".h5")).string());
  if (!settings_.vtu) return;
  const auto file = fmt::format("{}_{:04d}.vtu", settings_.name, pictures_);
  const auto& displacement = state_.motion.displacement;
  write_picture((folder / file).string(), body_->model.mesh, displacement,
                body_->stress.nodal_von_mises(displacement));
  if (!series_) series_.emplace((folder / (settings_.name + ".pvd")).string());
  series_->add(state_.motion.time, (folder / file).string());
}

/// All nodes as points of the surface "mesh", whose faces are those of the boundary; one row a picture.
void Structure::write_nodal(const std::string& path) {
  const auto& mesh = body_->model.mesh;
  const int dimension = mesh.dimension();
  if (!nodal_) {
    geometry::SurfaceMesh nodes;
    nodes.points = mesh.points();
    for (const auto& face : mesh.boundary()) nodes.add_face(face.kind, face.used());
    nodal_ = std::make_unique<io::SeriesWriter>(path);
    nodal_->add_surface("mesh", nodes);
  }
  nodal_->begin_window(state_.motion.time, state_.motion.time);
  std::vector<Vec3> values(mesh.nodes());
  const auto add = [&](const std::string& name, const Vector& nodal) {
    for (std::size_t n = 0; n < values.size(); ++n) values[n] = value_at(nodal, n, dimension);
    nodal_->add_field("mesh", name, values);
  };
  add("displacement", state_.motion.displacement);
  if (settings_.motion) add("velocity", state_.motion.velocity);
  const auto stress = body_->stress.nodal(state_.motion.displacement);
  for (std::size_t n = 0; n < values.size(); ++n) values[n] = principal(stress.col(static_cast<Eigen::Index>(n)));
  nodal_->add_field("mesh", "principal_stress", values);
  nodal_->flush();
}

// A picture of a window is drawn when the next begins, so that a rejected iteration leaves none.
void Structure::save() {
  if (state_.due) draw();
  saved_ = state_;
}

void Structure::restore() { state_ = saved_; }

namespace {
constexpr const char* program_version = "acopla-fem 0.1.0";

std::string checkpoint_file(const std::string& folder, const Settings& settings) { return fmt::format("{}/{}.h5", folder, settings.name); }
}  // namespace

template <class Archive>
void Structure::checkpointed(Archive& archive) {
  archive("motion", state_.motion);
  archive("passed", state_.passed);
  archive("drawn", state_.drawn);
  archive("start_energy", start_energy_);
  archive("worst_residual", worst_residual_);
  archive("pictures", pictures_);
}

void Structure::checkpoint(const std::string& folder) {
  if (state_.due) draw();
  io::State state;
  io::StateWriter writer(state);
  checkpointed(writer);
  io::write_checkpoint(checkpoint_file(folder, settings_), state,
                       {program_version, settings_.name, state_.motion.time, 0, std::to_string(body_->model.mesh.unknowns())});
}

void Structure::resume(const std::string& folder) {
  const auto path = checkpoint_file(folder, settings_);
  const auto [state, info] = io::read_checkpoint(path);
  io::check_origin(path, info, {program_version, settings_.name, 0, 0, std::to_string(body_->model.mesh.unknowns())});
  io::StateReader reader(state);
  checkpointed(reader);
  reader.finish();
  state_.due = false;
  saved_ = state_;
  if (run_.results.empty() || pictures_ == 0) return;
  const auto results = std::filesystem::path(run_.results) / settings_.name;
  if (settings_.hdf5) nodal_ = std::make_unique<io::SeriesWriter>(results.string() + ".h5", static_cast<std::size_t>(pictures_));
  if (!settings_.vtu) return;
  series_.emplace(results.string() + ".pvd");
  series_->keep_until(state_.motion.time);
}

std::vector<std::pair<std::string, double>> Structure::finish() {
  if (!state_.drawn) draw();
  nodal_.reset();
  std::vector<std::pair<std::string, double>> result{
      {"seconds.setup", seconds_.setup},
      {"seconds.factor", seconds_.factor},
      {"seconds.solve", seconds_.solve},
      {"dofs", static_cast<double>(body_->model.mesh.unknowns())}};
  if (body_->statics) result.emplace_back("factor.bytes", body_->statics->solver().factor_bytes);
  if (body_->dynamics) result.emplace_back("factor.bytes", body_->dynamics->solver().factor_bytes);
  if (body_->dynamics)
    result.emplace_back("factorisations", static_cast<double>(body_->dynamics->factorisations()));
  else if (body_->large_motion)
    result.emplace_back("factorisations", static_cast<double>(body_->large_motion->factorisations()));
  else
    result.emplace_back("residual", worst_residual_);
  if (settings_.condition) result.emplace_back("condition", body_->dynamics ? body_->dynamics->condition() : body_->statics->condition());
  if (team_) {
    const auto memory = peak_memory(*team_);
    result.emplace_back("processes", team_->size());
    result.emplace_back("memory.largest", memory.largest);
    result.emplace_back("memory.sum", memory.sum);
  }
  for (auto& frequency : frequencies()) result.push_back(std::move(frequency));
  return result;
}

std::vector<std::pair<std::string, double>> Structure::frequencies() const {
  std::vector<std::pair<std::string, double>> result;
  if (settings_.frequencies == 0) return result;
  const auto& [mesh, materials, supports, loads] = body_->model;
  const auto mass =
      assemble_mass(mesh, materials, settings_.formulation, body_->stiffness->pattern());
  const auto modes = natural_modes(mesh, *body_->stiffness, mass, supports.fixed(),
                                   settings_.frequencies, settings_.solver);
  for (std::size_t m = 0; m < modes.size(); ++m)
    result.emplace_back(fmt::format("frequency.{}", m + 1), modes[m].frequency);
  return result;
}

namespace {

// Measured on the meshes of cases/box_fill/make_meshes.py (44, 83 and 121 thousand unknowns, and
// the first with degree 2), processor time of one core of an EPYC with OpenBLAS 0.3.21: the
// factorisation runs at 0.30, 0.36, 0.36 and 0.46 of the rate of a product; a window, which reads
// the factor twice and finds reactions and stresses, takes 3.3 to 3.9 GB of the factor a second.
constexpr double factor_share = 0.36;
constexpr double solve_bytes_a_second = 3.5e9;

std::string surfaces_of(const Mesh& mesh) {
  std::string text;
  for (const auto& group : mesh.groups())
    if (group.dimension == mesh.dimension() - 1) text += (text.empty() ? "" : ", ") + group.name;
  return text.empty() ? "none" : text;
}

const char* cells_of(const Mesh& mesh) {
  if (mesh.dimension() == 2) return mesh.element().simplex ? "triangles" : "quadrilaterals";
  return mesh.element().simplex ? "tetrahedra" : "hexahedra";
}

std::string kinematics_of(const Settings& settings) {
  if (settings.dimension == 3) return "";
  return fmt::format(" in plane {}", settings.formulation.plane == Formulation::Plane::strain
                                         ? "strain"
                                         : "stress");
}

std::string scheme_of(const Settings::Motion& motion) {
  const auto& scheme = motion.scheme;
  return scheme.generalised
             ? fmt::format("generalised-α, β = {:.4g}, γ = {:.4g}, α_m = {:.4g}, α_f = {:.4g}",
                           scheme.beta, scheme.gamma, scheme.alpha_m, scheme.alpha_f)
             : fmt::format("Newmark, β = {:.4g}, γ = {:.4g}", scheme.beta, scheme.gamma);
}

double mass_of(const Settings& settings, const Model& model) {
  double mass = 0;
  const Vector unit =
      weight_loads(model.mesh, model.materials, Vec3(1, 0, 0), settings.formulation);
  mass = total(unit, model.mesh.dimension())[0];
  return mass;
}

}  // namespace

std::string explain(const Settings& settings) {
  const Model model(settings, Vec3::Zero());
  const auto& mesh = model.mesh;
  const auto& fixed = model.supports.fixed();
  if (settings.processes > 1) refuse_unshared(settings);
  const auto stiffness = stiffness_of(settings, model);
  // A matrix in motion has the same pattern as the stiffness, and so the same factor.
  auto options = settings.solver;
  if (settings.processes > 1) options.kind = SolverOptions::Kind::cg;
  auto solver = choose_solver(stiffness, mesh, fixed, options);
  if (settings.processes > 1) solver.why = fmt::format("it runs on {} processes", settings.processes);
  const double mass = mass_of(settings, model);
  std::string text = fmt::format(
      "{}: {} {} elasticity{}, {} {} of degree {}, {} nodes, {} unknowns ({} held)\n"
      "  surfaces of the mesh: {}\n  {} {:.6g} {}, {}\n",
      settings.name, settings.motion ? "dynamic" : "static",
      settings.formulation.large ? "geometrically nonlinear" : "linear", kinematics_of(settings),
      mesh.cells(), cells_of(mesh), settings.degree, mesh.nodes(), mesh.unknowns(),
      std::count(fixed.begin(), fixed.end(), 1), surfaces_of(mesh),
      mesh.dimension() == 2 ? "area" : "volume", mesh.volume(), mesh.dimension() == 2 ? "m2" : "m3",
      mass > 0 ? fmt::format("mass {:.6g} kg", mass) : "no density, so no weight");
  if (const auto doubt = doubtful_size(mesh); !doubt.empty()) text += "  warning: " + doubt + "\n";
  if (settings.motion)
    text += fmt::format("  time integration: {}\n", settings.formulation.large ? "energy and momentum kept, midpoint rule with Newton's method"
                                                                            : scheme_of(*settings.motion));
  text += fmt::format("  linear solver: {}, because {}\n",
                      solver.direct ? settings.formulation.large
                                          ? "direct (Cholesky, factored every iteration)"
                                          : "direct (Cholesky, factored once)"
                                    : "conjugate gradients with algebraic multigrid",
                      solver.why);
  // The direct solver hands CHOLMOD the lower triangle, in a form twice as large; motion adds the
  // effective matrix and the mass.
  const double matrices = settings.motion ? 3.2 : 2;
  const double memory =
      matrices * stiffness.bytes() + (solver.direct ? solver.factor_bytes : stiffness.bytes());
  text += fmt::format("  memory: about {:.2g} GiB{}\n", memory / settings.processes / (1ull << 30) + 0.2,
                      settings.processes > 1 ? fmt::format(" in each of {} processes, and the mesh in all of them", settings.processes) : "");
  if (solver.direct)
    text += fmt::format("  time: about {:.2g} s to factor, {:.2g} s a {}\n",
                        solver.flops / (factor_share * blas_rate()),
                        solver.factor_bytes / solve_bytes_a_second,
                        settings.motion ? "step" : "window");
  return text;
}

}  // namespace acopla::fem
