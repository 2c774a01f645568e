#include "fem/finite_strain.h"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
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

/// Stress of a point, the gradient that carries it, and the laws whose derivatives it has.
template <int d>
struct PointForce {
  using Square = Eigen::Matrix<double, d, d>;
  Square F, S;
  std::array<Hyperelastic<d>, 2> laws;
  int count = 1;
};

/// Visits the quadrature points. @param fields  displacements; @param visit  (cell, the deformation gradient of each field, ∇N_a as
/// [d, node], weight [m³])
template <int d, std::size_t n, class Visit>
void visit_points(const Mesh& mesh, const Formulation& formulation, const std::array<const Vector*, n>& fields, const Visit& visit) {
  using Square = Eigen::Matrix<double, d, d>;
  const auto& table = mesh.element().stiffness;
  const auto nodes = mesh.element().nodes;
  const double depth = d == 2 ? formulation.thickness : 1;
  std::array<Eigen::Matrix<double, d, Eigen::Dynamic>, n> moved;
  for (auto& m : moved) m.resize(d, nodes);
  Eigen::Matrix<double, d, Eigen::Dynamic> gradients(d, nodes);
  std::array<Square, n> F;
  for (std::size_t c = 0; c < mesh.cells(); ++c) {
    const auto x = mesh.positions<d>(c);
    const auto cell = mesh.cell(c);
    for (std::size_t f = 0; f < n; ++f)
      for (int a = 0; a < nodes; ++a)
        moved[f].col(a) = fields[f]->template segment<d>(d * Eigen::Index{cell[static_cast<std::size_t>(a)]});
    for (std::size_t q = 0; q < table.points(); ++q) {
      const Square J = x * table.gradients[q];
      const double weight = table.weights[static_cast<int>(q)] * J.determinant() * depth;
      gradients = (table.gradients[q] * J.inverse()).transpose();
      for (std::size_t f = 0; f < n; ++f) F[f] = Square::Identity() + moved[f] * gradients.transpose();
      visit(c, F, gradients, weight);
    }
  }
}

/// Adds forces and, where there is a tangent, the blocks of the laws. @param respond_at  (cell, deformation gradients, weight) → PointForce
template <int d, std::size_t n, class Respond>
void add_cells(const Mesh& mesh, const Formulation& formulation, const std::array<const Vector*, n>& fields,
               const Respond& respond_at, Vector& internal, BlockMatrix* tangent) {
  const auto nodes = mesh.element().nodes;
  const auto last = mesh.element().stiffness.points() - 1;
  Eigen::Matrix<double, d, Eigen::Dynamic> forces(d, nodes), pulled(d, nodes), pushed(d, nodes);
  forces.setZero();
  Eigen::MatrixXd cell_matrix = Eigen::MatrixXd::Zero(d * nodes, d * nodes);
  std::size_t point = 0;
  visit_points<d>(mesh, formulation, fields, [&](std::size_t c, const auto& F, const auto& gradients, double weight) {
    const PointForce<d> at = respond_at(c, F, weight);
    pulled = at.S * gradients;
    forces += weight * at.F * pulled;
    if (tangent) {
      for (int a = 0; a < nodes; ++a)
        for (int b = 0; b < nodes; ++b)
          cell_matrix.template block<d, d>(d * a, d * b).diagonal().array() += weight * gradients.col(a).dot(pulled.col(b));
      for (int k = 0; k < at.count; ++k) {
        const auto& law = at.laws[static_cast<std::size_t>(k)];
        pushed = law.push * gradients;
        for (int a = 0; a < nodes; ++a)
          for (int b = 0; b < nodes; ++b) {
            const double product = law.spatial ? pushed.col(a).dot(pushed.col(b)) : gradients.col(a).dot(gradients.col(b));
            cell_matrix.template block<d, d>(d * a, d * b) +=
                weight * (law.lambda * pushed.col(a) * pushed.col(b).transpose() +
                          law.m * pushed.col(b) * pushed.col(a).transpose() + product * law.G);
          }
      }
    }
    if (point++ < last) return;
    point = 0;
    const auto cell = mesh.cell(c);
    for (int a = 0; a < nodes; ++a)
      internal.segment<d>(d * Eigen::Index{cell[static_cast<std::size_t>(a)]}) += forces.col(a);
    if (tangent) tangent->add(cell, cell_matrix);
    forces.setZero();
    cell_matrix.setZero();
  });
}

/// ΔC below which the second part of S̄ is left out: it is of the order λ |ΔC|², and its round-off of λ 1e-16 / |ΔC|.
constexpr double smallest_strain = 1e-5;

/// S̄ of a step (Gonzalez 2000, eq. 43).
template <int d>
Eigen::Matrix<double, d, d> step_stress(const Material& material, double lambda, const Eigen::Matrix<double, d, d>& C0,
                                        const Eigen::Matrix<double, d, d>& C1) {
  using Square = Eigen::Matrix<double, d, d>;
  const Square change = C1 - C0;
  Square S = stress_of<d>(material, lambda, 0.5 * (C0 + C1));
  const double square = change.squaredNorm();
  if (material.law == Material::Law::st_venant_kirchhoff || square < smallest_strain * smallest_strain) return S;
  const double gap = energy_of<d>(material, lambda, C1) - energy_of<d>(material, lambda, C0) - 0.5 * S.cwiseProduct(change).sum();
  S += 2 * gap / square * change;
  return S;
}

}  // namespace

Linearisation linearise(const Mesh& mesh, const Materials& materials,
                        const Formulation& formulation, const Vector& displacement,
                        const std::shared_ptr<const CoupledNodes>& pattern) {
  Linearisation result{mesh.zero(), BlockMatrix(pattern, mesh.dimension())};
  with_dimension(mesh.dimension(), [&](auto d) {
    const auto respond_at = [&](std::size_t c, const auto& F, double) -> PointForce<d> {
      const auto& material = materials.of(c);
      const auto law = respond<d>(material, formulation.lambda(material, d), F[0]);
      return {F[0], law.S, {law}};
    };
    add_cells<d, 1>(mesh, formulation, {&displacement}, respond_at, result.internal, &result.tangent);
  });
  return result;
}

StepForce step_force(const Mesh& mesh, const Materials& materials, const Formulation& formulation,
                     const Vector& u0, const Vector& u1, double viscosity, BlockMatrix* tangent) {
  StepForce result{mesh.zero()};
  if (tangent) *tangent = BlockMatrix(tangent->pattern(), mesh.dimension());
  with_dimension(mesh.dimension(), [&](auto d) {
    using Square = Eigen::Matrix<double, d, d>;
    const auto respond_at = [&](std::size_t c, const auto& F, double weight) -> PointForce<d> {
      const auto& material = materials.of(c);
      const double lambda = formulation.lambda(material, d), mu = material.mu();
      const Square C0 = F[0].transpose() * F[0], C1 = F[1].transpose() * F[1], mean = 0.5 * (F[0] + F[1]);
      PointForce<d> at{mean, step_stress<d>(material, lambda, C0, C1), {}};
      if (tangent) at.laws[0] = respond<d>(material, lambda, mean);
      if (viscosity == 0) return at;
      const Square strain = 0.5 * (C1 - C0),
                   viscous = viscosity * (lambda * strain.trace() * Square::Identity() + 2 * mu * strain);
      result.dissipation += weight * viscous.cwiseProduct(strain).sum();
      at.S += viscous;
      at.laws[1] = {viscous, mean, 2 * viscosity * mu * mean * mean.transpose(), 2 * viscosity * lambda, 2 * viscosity * mu, false};
      at.count = 2;
      return at;
    };
    add_cells<d, 2>(mesh, formulation, {&u0, &u1}, respond_at, result.internal, tangent);
  });
  return result;
}

double strain_energy(const Mesh& mesh, const Materials& materials, const Formulation& formulation, const Vector& displacement) {
  double sum = 0;
  with_dimension(mesh.dimension(), [&](auto d) {
    visit_points<d, 1>(mesh, formulation, {&displacement}, [&](std::size_t c, const auto& F, const auto&, double weight) {
      const auto& material = materials.of(c);
      sum += weight * energy_of<d>(material, formulation.lambda(material, d), F[0].transpose() * F[0]);
    });
  });
  return sum;
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
