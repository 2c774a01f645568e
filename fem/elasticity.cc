#include "fem/elasticity.h"

#include <Eigen/LU>
#include <cmath>

namespace acopla::fem {
namespace {

/// ∫ ∇N_a ⊗ ∇N_b dV of a cell: block (a, b) of a matrix of 3 rows a node.
void gradient_products(const Table& table, const Eigen::Matrix3Xd& x, Eigen::MatrixXd& columns,
                       Eigen::MatrixXd& products) {
  const auto nodes = x.cols();
  columns.resize(3 * nodes, std::ssize(table.gradients));
  for (std::size_t q = 0; q < table.points(); ++q) {
    const Eigen::Matrix3d J = jacobian(x, table.gradients[q]);
    const double scale = std::sqrt(table.weights[static_cast<int>(q)] * J.determinant());
    const Eigen::Matrix3Xd gradient = scale * (table.gradients[q] * J.inverse()).transpose();
    columns.col(static_cast<int>(q)) = gradient.reshaped();
  }
  products.noalias() = columns * columns.transpose();
}

}  // namespace

BlockMatrix assemble_stiffness(const Mesh& mesh, const Material& material) {
  const double lambda = material.lambda(), mu = material.mu();
  const auto nodes = mesh.element().nodes;
  BlockMatrix stiffness(mesh.nodes(), mesh.cell_nodes(), static_cast<std::size_t>(nodes));
  Eigen::MatrixXd columns, products, cell_matrix(3 * nodes, 3 * nodes);
  for (std::size_t c = 0; c < mesh.cells(); ++c) {
    gradient_products(mesh.element().stiffness, mesh.positions(c), columns, products);
    for (int a = 0; a < nodes; ++a)
      for (int b = 0; b < nodes; ++b) {
        const Eigen::Matrix3d M = products.block<3, 3>(3 * a, 3 * b);
        cell_matrix.block<3, 3>(3 * a, 3 * b) = lambda * M + mu * M.transpose();
        cell_matrix.block<3, 3>(3 * a, 3 * b).diagonal().array() += mu * M.trace();
      }
    stiffness.add(mesh.cell(c), cell_matrix);
  }
  return stiffness;
}

Vector weight_loads(const Mesh& mesh, double density, const Vec3& gravity) {
  Vector loads = Vector::Zero(static_cast<Eigen::Index>(3 * mesh.nodes()));
  const auto& table = mesh.element().stiffness;
  for (std::size_t c = 0; c < mesh.cells(); ++c) {
    const auto x = mesh.positions(c);
    const auto cell = mesh.cell(c);
    for (std::size_t q = 0; q < table.points(); ++q) {
      const auto point = static_cast<int>(q);
      const double mass =
          density * table.weights[point] * jacobian(x, table.gradients[q]).determinant();
      for (std::size_t a = 0; a < cell.size(); ++a)
        loads.segment<3>(3 * Eigen::Index{cell[a]}) +=
            table.values(static_cast<int>(a), point) * mass * gravity;
    }
  }
  return loads;
}

}  // namespace acopla::fem
