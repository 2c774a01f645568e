#include "fem/elasticity.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>

namespace acopla::fem {
namespace {

/// ∇N_a sqrt(w det J) [m^(d/2)] at the quadrature points of a cell, [d nodes, point].
template <int d>
void scaled_gradients(const Table& table, const Eigen::Matrix<double, d, Eigen::Dynamic>& x,
                      Eigen::MatrixXd& columns) {
  columns.resize(d * x.cols(), std::ssize(table.gradients));
  for (std::size_t q = 0; q < table.points(); ++q) {
    const Eigen::Matrix<double, d, d> J = x * table.gradients[q];
    const double scale = std::sqrt(table.weights[static_cast<int>(q)] * J.determinant());
    const Eigen::Matrix<double, d, Eigen::Dynamic> gradient =
        scale * (table.gradients[q] * J.inverse()).transpose();
    columns.col(static_cast<int>(q)) = gradient.reshaped();
  }
}

/// G K_v⁻¹ Gᵀ of the volumetric strain's projection on the cell's functions ψ: G = ∫ ∇N_a ψ, K_v =
/// ∫ ψ ψᵀ (Hughes 1980).
template <int d>
Eigen::MatrixXd projected_products(const Element& element, const Eigen::MatrixXd& columns,
                                   const Eigen::Matrix<double, d, Eigen::Dynamic>& x) {
  const auto& table = element.stiffness;
  Eigen::MatrixXd psi = element.volumetric(table);  // [function, point]
  for (std::size_t q = 0; q < table.points(); ++q) {
    const Eigen::Matrix<double, d, d> J = x * table.gradients[q];
    psi.col(static_cast<int>(q)) *= std::sqrt(table.weights[static_cast<int>(q)] * J.determinant());
  }
  const Eigen::MatrixXd G = columns * psi.transpose(), Kv = psi * psi.transpose();
  return G * Kv.ldlt().solve(G.transpose());
}

template <int d>
void add_stiffness(const Mesh& mesh, const Materials& materials, const Formulation& formulation,
                   BlockMatrix& stiffness) {
  const auto nodes = mesh.element().nodes;
  const bool b_bar = formulation.locking == Formulation::Locking::b_bar;
  Eigen::MatrixXd columns, products, cell_matrix(d * nodes, d * nodes);
  for (std::size_t c = 0; c < mesh.cells(); ++c) {
    if (!stiffness.pattern()->touches(mesh.cell(c))) continue;
    const auto x = mesh.positions<d>(c);
    const auto& material = materials.of(c);
    const double mu = material.mu();
    // With B-bar the volumetric part, κ = λ + 2 μ / 3, takes the averaged strain; −2 μ / 3 stays
    // with the true one.
    const double lambda = b_bar ? -2 * mu / 3 : formulation.lambda(material, d);
    scaled_gradients<d>(mesh.element().stiffness, x, columns);
    products.noalias() = columns * columns.transpose();
    for (int a = 0; a < nodes; ++a)
      for (int b = 0; b < nodes; ++b) {
        const Eigen::Matrix<double, d, d> M = products.block<d, d>(d * a, d * b);
        auto block = cell_matrix.block<d, d>(d * a, d * b);
        block = lambda * M + mu * M.transpose();
        block.diagonal().array() += mu * M.trace();
      }
    if (b_bar)
      cell_matrix +=
          (material.lambda() + 2 * mu / 3) * projected_products<d>(mesh.element(), columns, x);
    if (d == 2) cell_matrix *= formulation.thickness;
    stiffness.add(mesh.cell(c), cell_matrix);
  }
}

/// ρ w det J [kg] at each point of a table.
template <int d>
Eigen::VectorXd masses(const Table& table, const Eigen::Matrix<double, d, Eigen::Dynamic>& x,
                       double density) {
  Eigen::VectorXd result(std::ssize(table.gradients));
  for (std::size_t q = 0; q < table.points(); ++q) {
    const Eigen::Matrix<double, d, d> J = x * table.gradients[q];
    result[static_cast<int>(q)] = density * table.weights[static_cast<int>(q)] * J.determinant();
  }
  return result;
}

double depth(const Mesh& mesh, const Formulation& formulation) {
  return mesh.dimension() == 2 ? formulation.thickness : 1.0;
}

}  // namespace

BlockMatrix assemble_stiffness(const Mesh& mesh, const Materials& materials,
                               const Formulation& formulation) {
  const auto nodes = static_cast<std::size_t>(mesh.element().nodes);
  return assemble_stiffness(mesh, materials, formulation, std::make_shared<CoupledNodes>(mesh.nodes(), mesh.cell_nodes(), nodes));
}

BlockMatrix assemble_stiffness(const Mesh& mesh, const Materials& materials, const Formulation& formulation, std::shared_ptr<const CoupledNodes> pattern) {
  BlockMatrix stiffness(std::move(pattern), mesh.dimension());
  with_dimension(mesh.dimension(),
                 [&](auto d) { add_stiffness<d>(mesh, materials, formulation, stiffness); });
  return stiffness;
}

MassMatrix assemble_mass(const Mesh& mesh, const Materials& materials,
                         const Formulation& formulation,
                         std::shared_ptr<const CoupledNodes> pattern) {
  MassMatrix mass(std::move(pattern), mesh.dimension());
  const auto& table = mesh.element().mass;
  with_dimension(mesh.dimension(), [&](auto d) {
    for (std::size_t c = 0; c < mesh.cells(); ++c) {
      if (!mass.pattern()->touches(mesh.cell(c))) continue;
      const double density = materials.of(c).density.value_or(0.0) * depth(mesh, formulation);
      const Eigen::VectorXd weights = masses<d>(table, mesh.positions<d>(c), density);
      mass.add(mesh.cell(c), table.values * weights.asDiagonal() * table.values.transpose());
    }
  });
  return mass;
}

Vector weight_loads(const Mesh& mesh, const Materials& materials, const Vec3& gravity,
                    const Formulation& formulation) {
  const int dimension = mesh.dimension();
  Vector loads = Vector::Zero(dimension * static_cast<Eigen::Index>(mesh.nodes()));
  const auto& table = mesh.element().stiffness;
  with_dimension(dimension, [&](auto d) {
    for (std::size_t c = 0; c < mesh.cells(); ++c) {
      const double density = materials.of(c).density.value_or(0.0) * depth(mesh, formulation);
      if (density == 0) continue;
      const Eigen::VectorXd shares = table.values * masses<d>(table, mesh.positions<d>(c), density);
      const auto cell = mesh.cell(c);
      for (std::size_t a = 0; a < cell.size(); ++a)
        add_at(loads, cell[a], d, shares[static_cast<int>(a)] * gravity);
    }
  });
  return loads;
}

}  // namespace acopla::fem
