#include "fem/structure.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>

#include "fem/cholesky.h"
#include "fem/interface.h"
#include "fem/picture.h"
#include "fem/statics.h"
#include "fem/stress.h"
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

Fixed fixed_unknowns(const Settings& settings, const Mesh& mesh) {
  const auto fixes = settings.table.table("fix");
  Fixed fixed(3 * mesh.nodes(), 0);
  for (const auto& fix : settings.fixes) try {
      hold(mesh.boundary(fix.group), fix.directions, fixed);
    } catch (const std::invalid_argument& error) {
      fixes.fail(fix.group, error.what());
    }
  const auto motions = free_motions(mesh, fixed);
  if (!motions.empty())
    settings.table.fail("fix", "leaves the structure free to " + motions +
                                   ". Fix another surface or more directions.");
  return fixed;
}

double largest_length(const Vector& nodal) {
  return std::sqrt(nodal.reshaped(3, nodal.size() / 3).colwise().squaredNorm().maxCoeff());
}

}  // namespace

struct Structure::Model {
  Mesh mesh;
  Fixed fixed;
  Statics statics;
  Stress stress;
  Vector weight;

  Model(const Settings& settings, const Vec3& gravity)
      : mesh(settings.mesh, settings.degree),
        fixed(fixed_unknowns(settings, mesh)),
        statics(mesh, settings.material, fixed, settings.solver),
        stress(mesh, settings.material),
        weight(weight_loads(mesh, settings.material.density.value_or(0.0), gravity)) {}
};

/// A surface that the coupling uses.
struct Structure::Coupled {
  protocol::Run::Use use;
  Interface interface;
};

Structure::Structure(Settings settings) : settings_(std::move(settings)) {}
Structure::~Structure() = default;

protocol::Introduction Structure::introduce() const {
  return {.solver = "fem", .dimension = 3, .capabilities = {"save"}};
}

namespace {

void check_fields(const Settings& settings, const protocol::Run::Use& use) {
  const auto refuse = [&](const std::string& field, const std::string& verb,
                          const std::string& known) {
    throw io::UserError(settings.table.location(),
                        fmt::format("{}.{} cannot {} \"{}\": a static structure {}s {}.",
                                    settings.name, use.surface, verb, field, verb, known));
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

}  // namespace

std::vector<protocol::Surface> Structure::start(const protocol::Run& run) {
  const Stopwatch setup;
  run_ = run;
  for (const auto& use : run.uses) check_fields(settings_, use);
  model_ = std::make_unique<Model>(settings_, Vec3(run.gravity[0], run.gravity[1], run.gravity[2]));
  std::vector<protocol::Surface> surfaces;
  for (const auto& use : run.uses) {
    coupled_.push_back({use, make_interface(settings_, model_->mesh, use.surface)});
    surfaces.push_back({use.surface, coupled_.back().interface.surface()});
  }
  seconds_.setup = setup.seconds();
  const Stopwatch factor;
  model_->statics.prepare();
  seconds_.factor = factor.seconds();
  return surfaces;
}

Vector Structure::load_of(const std::vector<protocol::Field>& received) const {
  Vector load = model_->weight;
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
  for (const auto& [use, interface] : coupled_)
    for (const auto& name : use.sends) {
      const bool moves = name == "displacement";
      auto values = moves ? interface.values(state_.displacement)
                          : std::vector<Vec3>(interface.nodes().size(), Vec3::Zero());
      result.push_back({use.surface, name, std::move(values)});
    }
  return result;
}

protocol::Advance Structure::advance(const protocol::Window& window,
                                     const std::vector<protocol::Field>& received) {
  if (state_.due) draw();
  const auto load = load_of(received);
  const Stopwatch solve;
  const auto solution = model_->statics.solve(load, state_.displacement);
  const auto peak = model_->stress.peak(solution.displacement);
  seconds_.solve += solve.seconds();
  worst_residual_ = std::max(worst_residual_, solution.residual);
  state_ = {solution.displacement, window.end_time(), is_due(window), false};

  protocol::Advance result;
  result.fields = fields();
  const Vec3 reaction = solution.total_reaction(), sum = total(load);
  for (int d = 0; d < 3; ++d)
    result.quantities.emplace_back(std::string("reaction.") + "xyz"[d], reaction[d]);
  for (int d = 0; d < 3; ++d)
    result.quantities.emplace_back(std::string("load.") + "xyz"[d], sum[d]);
  result.quantities.emplace_back("displacement.max", largest_length(solution.displacement));
  result.quantities.emplace_back("von_mises.max", peak.value);
  result.steps = 1;
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
  if (!settings_.vtu || run_.results.empty()) return;
  const auto folder = std::filesystem::path(run_.results);
  std::filesystem::create_directories(folder);
  const auto file = fmt::format("{}_{:04d}.vtu", settings_.name, ++pictures_);
  write_picture((folder / file).string(), model_->mesh, state_.displacement,
                model_->stress.nodal_von_mises(state_.displacement));
  if (!series_) series_.emplace((folder / (settings_.name + ".pvd")).string());
  series_->add(state_.time, (folder / file).string());
}

// A picture of a window is drawn when the next begins, so that a rejected iteration leaves none.
void Structure::save() {
  if (state_.due) draw();
  saved_ = state_;
}

void Structure::restore() { state_ = saved_; }

std::vector<std::pair<std::string, double>> Structure::finish() {
  if (!state_.drawn) draw();
  const auto& statics = model_->statics;
  return {{"seconds.setup", seconds_.setup},
          {"seconds.factor", seconds_.factor},
          {"seconds.solve", seconds_.solve},
          {"dofs", static_cast<double>(3 * model_->mesh.nodes())},
          {"factor.bytes", statics.solver().factor_bytes},
          {"residual", worst_residual_}};
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
    if (group.dimension == 2) text += (text.empty() ? "" : ", ") + group.name;
  return text.empty() ? "none" : text;
}

}  // namespace

std::string explain(const Settings& settings) {
  const Mesh mesh(settings.mesh, settings.degree);
  const auto fixed = fixed_unknowns(settings, mesh);
  const Statics statics(mesh, settings.material, fixed, settings.solver);
  const auto& solver = statics.solver();
  const auto held = std::count(fixed.begin(), fixed.end(), 1);
  std::string text = fmt::format(
      "{}: static linear elasticity, {} {} of degree {}, {} nodes, {} unknowns ({} held)\n"
      "  surfaces of the mesh: {}\n  volume {:.6g} m3, {}\n",
      settings.name, mesh.cells(), mesh.element().simplex ? "tetrahedra" : "hexahedra",
      settings.degree, mesh.nodes(), 3 * mesh.nodes(), held, surfaces_of(mesh), mesh.volume(),
      settings.material.density
          ? fmt::format("mass {:.6g} kg", mesh.volume() * *settings.material.density)
          : "no density, so no weight");
  text += fmt::format("  linear solver: {}, because {}\n",
                      solver.direct ? "direct (Cholesky, factored once)"
                                    : "conjugate gradients with algebraic multigrid",
                      solver.why);
  const auto stiffness_bytes = static_cast<double>(statics.stiffness().blocks()) * 76;
  // The direct solver hands CHOLMOD the lower triangle, in a form twice as large.
  const double memory =
      2 * stiffness_bytes + (solver.direct ? solver.factor_bytes : stiffness_bytes);
  text += fmt::format("  memory: about {:.2g} GiB\n", memory / (1ull << 30) + 0.2);
  if (solver.direct)
    text += fmt::format("  time: about {:.2g} s to factor, {:.2g} s a window\n",
                        solver.flops / (factor_share * blas_rate()),
                        solver.factor_bytes / solve_bytes_a_second);
  return text;
}

}  // namespace acopla::fem
