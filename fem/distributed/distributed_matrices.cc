#include "fem/distributed/distributed_matrices.h"

#include <sys/resource.h>

#include <fmt/format.h>

#include "fem/distributed/share.h"

namespace acopla::fem {
namespace {

enum Task : std::int64_t { make_share, assemble, norm_of_stiffness, multiply_by, prepare_system, drop_system, solve_system, measure_memory };

Memory agree_on_memory(Team& team) {
  rusage use{};
  getrusage(RUSAGE_SELF, &use);
  const double bytes = 1024.0 * static_cast<double>(use.ru_maxrss);
  return {team.largest(bytes), team.sum(bytes)};
}

}  // namespace

/// One of the systems of all processes.
class DistributedMatrices::Solver : public LinearSolver {
 public:
  Solver(const DistributedMatrices& all, std::int64_t id, double k, double m, double tolerance)
      : all_(all), id_(id), k_(k), m_(m), tolerance_(tolerance) {}
  ~Solver() override {
    if (!prepared_ || all_.team_.broken()) return;
    try {
      all_.team_.lead({.task = drop_system, .id = id_}, [&] { all_.share_->drop(id_); });
    } catch (const std::exception&) {
      // Who dropped it is ending: the error that it ends with is told elsewhere.
    }
  }
  void prepare() override {
    all_.team_.lead({.task = prepare_system, .id = id_, .a = k_, .b = m_, .c = tolerance_}, [&] { all_.share_->prepare(id_, k_, m_, tolerance_); });
    prepared_ = true;
  }
  void solve(const Vector& f, Vector& u) override {
    all_.team_.lead({.task = solve_system, .id = id_}, [&] { all_.share_->solve(id_, &f, &u); });
  }

 private:
  const DistributedMatrices& all_;
  std::int64_t id_;
  double k_, m_, tolerance_;
  bool prepared_ = false;
};

DistributedMatrices::DistributedMatrices(Team& team, const Settings& settings, const Model& model, bool with_mass)
    : team_(team), settings_(settings), model_(model) {
  team_.lead({.task = make_share, .text = settings.name + '\n' + settings.table.file()}, [&] { share_ = std::make_unique<Share>(team_, settings_, model_); });
  if (with_mass) team_.lead({.task = assemble}, [&] { share_->assemble_mass(); });
}

DistributedMatrices::~DistributedMatrices() = default;

double DistributedMatrices::norm() const {
  double result = 0;
  team_.lead({.task = norm_of_stiffness}, [&] { result = share_->norm(); });
  return result;
}

void DistributedMatrices::stiffness(const Vector& x, Vector& result) const {
  team_.lead({.task = multiply_by, .id = static_cast<int>(Share::Matrix::stiffness)}, [&] { share_->multiply(Share::Matrix::stiffness, &x, &result); });
}

void DistributedMatrices::mass(const Vector& x, Vector& result) const {
  team_.lead({.task = multiply_by, .id = static_cast<int>(Share::Matrix::mass)}, [&] { share_->multiply(Share::Matrix::mass, &x, &result); });
}

namespace {

void copy_rows(const Vector& from, std::span<const std::uint32_t> nodes, int d, Vector& to) {
  for (const auto node : nodes) to.segment(d * static_cast<Eigen::Index>(node), d) = from.segment(d * static_cast<Eigen::Index>(node), d);
}

}  // namespace

void DistributedMatrices::stiffness(const Vector& x, std::span<const std::uint32_t> nodes, Vector& result) const {
  Vector product;
  stiffness(x, product);
  copy_rows(product, nodes, dimension(), result);
}

void DistributedMatrices::mass(const Vector& x, std::span<const std::uint32_t> nodes, Vector& result) const {
  Vector product;
  mass(x, product);
  copy_rows(product, nodes, dimension(), result);
}

ChosenSolver DistributedMatrices::solver(double k, double m, const SolverOptions& options) const {
  ChosenSolver chosen;
  chosen.direct = false;
  chosen.solver = std::make_unique<Solver>(*this, solvers_++, k, m, options.tolerance);
  chosen.why = fmt::format("it runs on {} processes", team_.size());
  return chosen;
}

/// Of nodes on the surfaces of a coupling, so few that this process assembles what is around them once more.
std::vector<double> DistributedMatrices::sudden(std::span<const std::uint32_t> nodes) const {
  const auto& mesh = model_.mesh;
  std::vector<char> asked(mesh.nodes(), 0), rows(mesh.nodes(), 0);
  for (const auto node : nodes) asked[node] = 1;
  for (std::size_t c = 0; c < mesh.cells(); ++c) {
    const auto cell = mesh.cell(c);
    if (std::any_of(cell.begin(), cell.end(), [&](auto node) { return asked[node]; }))
      for (const auto node : cell) rows[node] = 1;
  }
  const auto mass = assemble_mass(
      mesh, model_.materials, settings_.formulation,
      std::make_shared<CoupledNodes>(mesh.nodes(), mesh.cell_nodes(), static_cast<std::size_t>(mesh.element().nodes), rows));
  std::vector<double> result;
  for (const auto node : nodes) result.push_back(mass.sudden(node));
  return result;
}

Memory peak_memory(Team& team) {
  Memory result;
  team.lead({.task = measure_memory}, [&] { result = agree_on_memory(team); });
  return result;
}

void serve_matrices(Team& team) {
  std::optional<Settings> settings;
  std::optional<Model> model;
  std::unique_ptr<Share> share;
  team.follow([&](const Order& order) {
    switch (order.task) {
      case make_share: {
        const auto cut = order.text.find('\n');
        settings.emplace(read_settings(io::Table::from_file(order.text.substr(cut + 1)), order.text.substr(0, cut)));
        model.emplace(*settings, Vec3::Zero());  // loads and their weight are the first process's
        share = std::make_unique<Share>(team, *settings, *model);
        return;
      }
      case assemble:
        return share->assemble_mass();
      case norm_of_stiffness:
        share->norm();
        return;
      case multiply_by:
        return share->multiply(static_cast<Share::Matrix>(order.id), nullptr, nullptr);
      case prepare_system:
        return share->prepare(order.id, order.a, order.b, order.c);
      case drop_system:
        return share->drop(order.id);
      case solve_system:
        return share->solve(order.id, nullptr, nullptr);
      case measure_memory:
        agree_on_memory(team);
        return;
      default:
        throw std::logic_error("an unknown order");
    }
  });
}

void refuse_unshared(const Settings& settings) {
  const auto refuse = [&](const io::Table& table, const char* key, const std::string& what) {
    table.fail(key, what + " on one process alone: leave out `processes` and mpirun, or this.");
  };
  if (settings.formulation.large) refuse(settings.table, "displacements", "= \"large\" works");
  if (settings.frequencies > 0) refuse(settings.table.table("output"), "frequencies", "are found");
  if (settings.solver.kind == SolverOptions::Kind::direct) refuse(settings.table, "linear_solver", "= \"direct\" works");
}

}  // namespace acopla::fem
