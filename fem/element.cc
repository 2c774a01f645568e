#include "fem/element.h"

#include <deal.II/base/quadrature_lib.h>
#include <deal.II/fe/fe_q.h>
#include <deal.II/fe/fe_simplex_p.h>

#include <Eigen/QR>

#include "fem/discretisation.h"
#include "fem/nodal.h"

namespace acopla::fem {
namespace {

template <int d>
Eigen::MatrixXd coordinates(const std::vector<dealii::Point<d>>& points) {
  Eigen::MatrixXd result(d, std::ssize(points));
  for (std::size_t q = 0; q < points.size(); ++q)
    for (unsigned c = 0; c < d; ++c)
      result(static_cast<int>(c), static_cast<int>(q)) = points[q][c];
  return result;
}

template <int d>
Table tabulate(const dealii::FiniteElement<d>& element,
               const std::vector<dealii::Point<d>>& points) {
  const auto nodes = static_cast<int>(element.n_dofs_per_cell());
  Table table;
  table.points_in_cell = coordinates<d>(points);
  table.values.resize(nodes, static_cast<int>(points.size()));
  for (std::size_t q = 0; q < points.size(); ++q) {
    Eigen::MatrixXd gradient(nodes, d);
    for (int a = 0; a < nodes; ++a) {
      const auto node = static_cast<unsigned>(a);
      table.values(a, static_cast<int>(q)) = element.shape_value(node, points[q]);
      const auto slope = element.shape_grad(node, points[q]);
      for (unsigned c = 0; c < d; ++c) gradient(a, static_cast<int>(c)) = slope[c];
    }
    table.gradients.push_back(std::move(gradient));
  }
  return table;
}

template <int d>
Table tabulate(const dealii::FiniteElement<d>& element, const dealii::Quadrature<d>& quadrature) {
  Table table = tabulate<d>(element, quadrature.get_points());
  const auto& weights = quadrature.get_weights();
  table.weights = Eigen::Map<const Eigen::VectorXd>(weights.data(), std::ssize(weights));
  return table;
}

template <int d>
dealii::Quadrature<d> quadrature(bool simplex, int points_a_direction) {
  const auto count = static_cast<unsigned>(points_a_direction);
  if (simplex) return dealii::QGaussSimplex<d>(count);
  return dealii::QGauss<d>(count);
}

/// Exact for products of two shape functions, of degree 2 or 4 on simplices.
template <int d>
dealii::Quadrature<d> mass_quadrature(bool simplex, int degree) {
  const auto count = static_cast<unsigned>(degree + 1);
  if (simplex) return dealii::QWitherdenVincentSimplex<d>(count);
  return dealii::QGauss<d>(count);
}

template <int d>
Eigen::MatrixXd fit(const dealii::FiniteElement<d>& element, const dealii::FiniteElement<d>& linear,
                    const std::vector<dealii::Point<d>>& points) {
  const auto nodes = static_cast<int>(element.n_dofs_per_cell());
  if (points.size() == 1) return Eigen::MatrixXd::Ones(nodes, 1);
  // Values c at the corners such that A c fits those at the points, by least squares.
  const auto count = std::ssize(points);
  const Eigen::MatrixXd at_points = tabulate<d>(linear, points).values.transpose();
  const Eigen::MatrixXd corners =
      at_points.colPivHouseholderQr().solve(Eigen::MatrixXd::Identity(count, count));
  return tabulate<d>(linear, element.get_unit_support_points()).values.transpose() * corners;
}

}  // namespace

template <int d>
std::unique_ptr<dealii::FiniteElement<d>> make_element(bool simplex, int degree) {
  const auto order = static_cast<unsigned>(degree);
  if (simplex) return std::make_unique<dealii::FE_SimplexP<d>>(order);
  return std::make_unique<dealii::FE_Q<d>>(order);
}
template std::unique_ptr<dealii::FiniteElement<2>> make_element<2>(bool, int);
template std::unique_ptr<dealii::FiniteElement<3>> make_element<3>(bool, int);

Element::Element(int dimension_, bool simplex_, int degree_)
    : dimension(dimension_), simplex(simplex_), degree(degree_) {
  with_dimension(dimension, [&](auto d) {
    const auto element = make_element<d>(simplex, degree), linear = make_element<d>(simplex, 1);
    nodes = static_cast<int>(element->n_dofs_per_cell());
    support = coordinates<d>(element->get_unit_support_points());
    stiffness = tabulate<d>(*element, quadrature<d>(simplex, simplex ? degree : degree + 1));
    mass = tabulate<d>(*element, mass_quadrature<d>(simplex, degree));
    const auto points = quadrature<d>(simplex, simplex ? degree : 2);
    stress = tabulate<d>(*element, points);
    extrapolation = fit<d>(*element, *linear, points.get_points());
  });
}

Eigen::MatrixXd Element::volumetric(const Table& table) const {
  const auto count = std::ssize(table.gradients);
  Eigen::MatrixXd result = Eigen::MatrixXd::Ones(degree == 1 ? 1 : 1 + dimension, count);
  if (degree == 2) result.bottomRows(dimension) = table.points_in_cell;
  return result;
}

}  // namespace acopla::fem
