#include "fem/finite_strain.h"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "fem/hyperelastic.h"
#include "io/error.h"

namespace acopla::fem {
namespace {

/// Residual of an equilibrium, relative to the loads and reactions.
constexpr double converged = 1e-11;
/// Change of the displacements, relative, below which an iteration has nothing left to do.
constexpr double smallest_change = 1e-11;
constexpr int most_iterations = 25;
/// Smallest part of a load that a step may be.
constexpr double smallest_step = 1.0 / 1024;

template <int d>
void add_cells(const Mesh& mesh, const Materials& materials, const Formulation& formulation,
               const Vector& u, Linearisation& result) {
  using Square = Eigen::Matrix<double, d, d>;
  const auto& table = mesh.element().stiffness;
  const auto nodes = mesh.element().nodes;
  const double depth = d == 2 ? formulation.thickness : 1;
  Eigen::Matrix<double, d, Eigen::Dynamic> moved(d, nodes), gradients(d, nodes), forces(d, nodes);
  Eigen::MatrixXd cell_matrix(d * nodes, d * nodes);
  for (std::size_t c = 0; c < mesh.cells(); ++c) {
    const auto x = mesh.positions<d>(c);
    const auto cell = mesh.cell(c);
    for (int a = 0; a < nodes; ++a)
      moved.col(a) = u.segment<d>(d * Eigen::Index{cell[static_cast<std::size_t>(a)]});
    const auto& material = materials.of(c);
    const double lambda = formulation.lambda(material, d);
    forces.setZero();
    cell_matrix.setZero();
    for (std::size_t q = 0; q < table.points(); ++q) {
      const Square J = x * table.gradients[q];
      const double weight = table.weights[static_cast<int>(q)] * J.determinant() * depth;
      gradients = (table.gradients[q] * J.inverse()).transpose();
      const Square F = Square::Identity() + moved * gradients.transpose();
      const auto law = respond<d>(material, lambda, F);
      const Eigen::Matrix<double, d, Eigen::Dynamic> pulled = law.S * gradients, pushed = law.push * gradients;
      forces += weight * F * pulled;
      for (int a = 0; a < nodes; ++a)
        for (int b = 0; b < nodes; ++b) {
          const double initial = gradients.col(a).dot(pulled.col(b)),
                       product = law.spatial ? pushed.col(a).dot(pushed.col(b)) : gradients.col(a).dot(gradients.col(b));
          auto block = cell_matrix.template block<d, d>(d * a, d * b);
          block += weight * (law.lambda * pushed.col(a) * pushed.col(b).transpose() +
                             law.m * pushed.col(b) * pushed.col(a).transpose() + product * law.G);
          block.diagonal().array() += weight * initial;
        }
    }
    for (int a = 0; a < nodes; ++a)
      result.internal.segment<d>(d * Eigen::Index{cell[static_cast<std::size_t>(a)]}) +=
          forces.col(a);
    result.tangent.add(cell, cell_matrix);
  }
}

}  // namespace

Linearisation linearise(const Mesh& mesh, const Materials& materials,
                        const Formulation& formulation, const Vector& displacement,
                        const std::shared_ptr<const CoupledNodes>& pattern) {
  Linearisation result{mesh.zero(), BlockMatrix(pattern, mesh.dimension())};
  with_dimension(mesh.dimension(),
                 [&](auto d) { add_cells<d>(mesh, materials, formulation, displacement, result); });
  return result;
}

LargeDisplacements::LargeDisplacements(const Mesh& mesh, const Materials& materials,
                                       const Fixed& fixed, const SolverOptions& options,
                                       const Formulation& formulation)
    : mesh_(mesh),
      materials_(materials),
      fixed_(fixed),
      options_(options),
      formulation_(formulation),
      pattern_(std::make_shared<CoupledNodes>(mesh.nodes(), mesh.cell_nodes(),
                                              static_cast<std::size_t>(mesh.element().nodes))),
      displacement_(mesh.zero()),
      load_(mesh.zero()) {}

void LargeDisplacements::restart_from(const Vector& displacement, const Vector& load) {
  displacement_ = displacement;
  load_ = load;
}

double LargeDisplacements::norm_of_free(const Vector& residual) const {
  double sum = 0;
  for (Eigen::Index i = 0; i < residual.size(); ++i)
    if (!fixed_[static_cast<std::size_t>(i)]) sum += residual[i] * residual[i];
  return std::sqrt(sum);
}

/// @return false when Newton's method does not get there
bool LargeDisplacements::equilibrate(const Vector& load, const Vector& prescribed, Vector& u) {
  Vector jump =
      prescribed - u;  // of held unknowns, taken in the first iteration by its linearisation
  for (Eigen::Index i = 0; i < jump.size(); ++i)
    if (!fixed_[static_cast<std::size_t>(i)]) jump[i] = 0;
  bool jumps = jump.squaredNorm() > 0;
  auto now = linearise(mesh_, materials_, formulation_, u, pattern_);
  bool still = false;  // the last step changed nothing that counts: round-off of membrane forces is
                       // what is left
  for (int iteration = 0; iteration < most_iterations; ++iteration) {
    Vector residual = load - now.internal;
    const double norm = norm_of_free(residual);
    if (!std::isfinite(norm)) return false;
    if (!jumps && (still || norm <= converged * (load.norm() + now.internal.norm()))) return true;
    ++iterations_;
    Vector step, product;
    if (jumps) {
      now.tangent.multiply(jump, product);
      residual -= product;
    }
    try {
      const auto solver = choose_solver(now.tangent, mesh_, fixed_, options_);
      solver.solver->prepare();
      solver.solver->solve(residual, step);
    } catch (const io::UserError&) {
      return false;  // no tangent that is positive definite: too far, or buckling
    }
    // Line search: the work of the residual along the step must fall (Crisfield 1991, §9.2). Not in
    // the first iteration, which takes the load or the jump as a whole: of slender bodies it leaves
    // membrane forces that the second takes away.
    const Vector before = jumps ? Vector(u + jump) : u;
    const double work = residual.dot(step);
    for (double share = 1;; share *= 0.5) {
      u = before + share * step;
      now = linearise(mesh_, materials_, formulation_, u, pattern_);
      if (iteration == 0 || std::abs(step.dot(load - now.internal)) <= 0.9 * std::abs(work) ||
          share < 0.1)
        break;
    }
    still = !jumps && step.norm() <= smallest_change * u.norm();
    jumps = false;
  }
  return false;
}

StaticSolution LargeDisplacements::solve(const Vector& load, const Vector& prescribed) {
  const Vector target = prescribed.size() > 0 ? prescribed : Vector(mesh_.zero());
  const Vector load_before = load_, displacement_before = displacement_;
  double reached = 0, step = 1;
  while (reached < 1) {
    const double next = std::min(1.0, reached + step);
    Vector u = displacement_;
    if (equilibrate(load_before + next * (load - load_before),
                    displacement_before + next * (target - displacement_before), u)) {
      displacement_ = u;
      reached = next;
      step *= 2;
    } else {
      step *= 0.5;
      if (step < smallest_step)
        throw std::runtime_error(
            fmt::format("no equilibrium was found beyond {:.3g} of the load's last change. The "
                        "structure may buckle or fold there: load it in "
                        "smaller windows, or look at its shape before.",
                        reached));
    }
  }
  load_ = load;
  StaticSolution result;
  result.dimension = mesh_.dimension();
  result.displacement = displacement_;
  result.reaction =
      linearise(mesh_, materials_, formulation_, displacement_, pattern_).internal - load;
  result.residual =
      norm_of_free(result.reaction) / std::max(load.norm(), result.reaction.norm() + 1e-300);
  for (Eigen::Index i = 0; i < load.size(); ++i)
    if (!fixed_[static_cast<std::size_t>(i)]) result.reaction[i] = 0;
  return result;
}

}  // namespace acopla::fem
