#include "fem/distributed/share.h"

#include "fem/distributed/shared_system.h"

namespace acopla::fem {
namespace {

std::shared_ptr<const CoupledNodes> rows_of(const Mesh& mesh, std::span<const std::uint32_t> nodes) {
  std::vector<char> rows(mesh.nodes(), 0);
  for (const auto node : nodes) rows[node] = 1;
  return std::make_shared<CoupledNodes>(mesh.nodes(), mesh.cell_nodes(), static_cast<std::size_t>(mesh.element().nodes), rows);
}

}  // namespace

Share::Share(Team& team, const Settings& settings, const Model& model)
    : team_(team), settings_(settings), model_(model), partition_(model.mesh, team), sizes_(partition_.sizes(model.mesh.dimension())) {
  const auto& mesh = model.mesh;
  stiffness_.emplace(assemble_stiffness(mesh, model.materials, settings.formulation, rows_of(mesh, partition_.nodes(team.rank()))));
  for (const auto& foundation : settings.foundations) add_stiffness(foundation, mesh, settings.formulation, *stiffness_);
}

Share::~Share() = default;

void Share::assemble_mass() { mass_.emplace(fem::assemble_mass(model_.mesh, model_.materials, settings_.formulation, stiffness_->pattern())); }

double Share::norm() { return team_.largest(stiffness_->norm()); }

void Share::multiply(Matrix matrix, const Vector* x, Vector* result) {
  Vector whole = x ? *x : model_.mesh.zero(), product = model_.mesh.zero();
  team_.send_to_all(std::span(whole.data(), static_cast<std::size_t>(whole.size())));
  const auto nodes = partition_.nodes(team_.rank());
  if (matrix == Matrix::mass)
    mass_->multiply(whole, nodes, product);
  else
    stiffness_->multiply(whole, nodes, product);
  const int d = model_.mesh.dimension();
  Vector part(sizes_[static_cast<std::size_t>(team_.rank())]);
  for (std::size_t k = 0; k < nodes.size(); ++k)
    part.segment(d * static_cast<Eigen::Index>(k), d) = product.segment(d * static_cast<Eigen::Index>(nodes[k]), d);
  gather(part, result);
}

void Share::prepare(std::int64_t id, double k, double m, double tolerance) {
  systems_.erase(id);
  const auto make = [&](const BlockMatrix& matrix) {
    systems_[id] = std::make_unique<SharedSystem>(team_, partition_, model_.mesh, model_.supports.fixed(), matrix, tolerance);
  };
  if (k == 1 && m == 0)
    make(*stiffness_);
  else
    make(combine(k, *stiffness_, m, *mass_));
}

void Share::drop(std::int64_t id) { systems_.erase(id); }

void Share::solve(std::int64_t id, const Vector* f, Vector* u) {
  Vector right, x;
  scatter(f, right);
  const Vector guess = u && u->size() == f->size() ? *u : model_.mesh.zero();
  scatter(u ? &guess : nullptr, x);
  systems_.at(id)->solve(right, x);
  gather(x, u);
}

void Share::scatter(const Vector* whole, Vector& part) {
  const int d = model_.mesh.dimension();
  Vector sorted;
  if (whole) {
    sorted.resize(whole->size());
    for (std::size_t k = 0; k < partition_.order().size(); ++k)
      sorted.segment(d * static_cast<Eigen::Index>(k), d) = whole->segment(d * static_cast<Eigen::Index>(partition_.order()[k]), d);
  }
  part.resize(sizes_[static_cast<std::size_t>(team_.rank())]);
  team_.scatter(sorted.data(), sizes_, part.data());
}

void Share::gather(const Vector& part, Vector* whole) {
  const int d = model_.mesh.dimension();
  Vector sorted;
  if (whole) sorted.resize(static_cast<Eigen::Index>(model_.mesh.unknowns()));
  team_.gather(part.data(), sizes_, sorted.data());
  if (!whole) return;
  whole->resize(sorted.size());
  for (std::size_t k = 0; k < partition_.order().size(); ++k)
    whole->segment(d * static_cast<Eigen::Index>(partition_.order()[k]), d) = sorted.segment(d * static_cast<Eigen::Index>(k), d);
}

}  // namespace acopla::fem
