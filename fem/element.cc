#include "fem/element.h"

#include <deal.II/base/quadrature_lib.h>
#include <deal.II/fe/fe_q.h>
#include <deal.II/fe/fe_simplex_p.h>

#include <Eigen/QR>

#include "fem/discretisation.h"

namespace acopla::fem {
namespace {

Table tabulate(const dealii::FiniteElement<3>& element,
               const std::vector<dealii::Point<3>>& points) {
  const auto nodes = static_cast<int>(element.n_dofs_per_cell());
  Table table;
  table.values.resize(nodes, static_cast<int>(points.size()));
  for (std::size_t q = 0; q < points.size(); ++q) {
    Eigen::Matrix<double, Eigen::Dynamic, 3> gradient(nodes, 3);
    for (int a = 0; a < nodes; ++a) {
      const auto node = static_cast<unsigned>(a);
      table.values(a, static_cast<int>(q)) = element.shape_value(node, points[q]);
      const auto slope = element.shape_grad(node, points[q]);
      gradient.row(a) = Eigen::RowVector3d(slope[0], slope[1], slope[2]);
    }
    table.gradients.push_back(std::move(gradient));
  }
  return table;
}

Table tabulate(const dealii::FiniteElement<3>& element, const dealii::Quadrature<3>& quadrature) {
  Table table = tabulate(element, quadrature.get_points());
  const auto& weights = quadrature.get_weights();
  table.weights = Eigen::Map<const Eigen::VectorXd>(weights.data(), std::ssize(weights));
  return table;
}

dealii::Quadrature<3> quadrature(bool simplex, int points_a_direction) {
  const auto count = static_cast<unsigned>(points_a_direction);
  if (simplex) return dealii::QGaussSimplex<3>(count);
  return dealii::QGauss<3>(count);
}

Eigen::MatrixXd fit(const dealii::FiniteElement<3>& element, const dealii::FiniteElement<3>& linear,
                    const std::vector<dealii::Point<3>>& points) {
  const auto nodes = static_cast<int>(element.n_dofs_per_cell());
  if (points.size() == 1) return Eigen::MatrixXd::Ones(nodes, 1);
  // Values c at the corners such that A c fits those at the points, by least squares.
  const auto count = std::ssize(points);
  const Eigen::MatrixXd at_points = tabulate(linear, points).values.transpose();
  const Eigen::MatrixXd corners =
      at_points.colPivHouseholderQr().solve(Eigen::MatrixXd::Identity(count, count));
  return tabulate(linear, element.get_unit_support_points()).values.transpose() * corners;
}

}  // namespace

std::unique_ptr<dealii::FiniteElement<3>> make_element(bool simplex, int degree) {
  const auto order = static_cast<unsigned>(degree);
  if (simplex) return std::make_unique<dealii::FE_SimplexP<3>>(order);
  return std::make_unique<dealii::FE_Q<3>>(order);
}

Element::Element(bool simplex_, int degree_) : simplex(simplex_), degree(degree_) {
  const auto element = make_element(simplex, degree), linear = make_element(simplex, 1);
  nodes = static_cast<int>(element->n_dofs_per_cell());
  stiffness = tabulate(*element, quadrature(simplex, simplex ? degree : degree + 1));
  const auto points = quadrature(simplex, simplex ? degree : 2);
  stress = tabulate(*element, points);
  extrapolation = fit(*element, *linear, points.get_points());
}

}  // namespace acopla::fem
