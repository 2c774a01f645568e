#include "fem/modes.h"

#include <deal.II/lac/arpack_solver.h>
#include <deal.II/lac/vector.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <stdexcept>

#include "fem/dealii_error.h"

namespace acopla::fem {
namespace {

using DealVector = dealii::Vector<double>;

/// M among the free unknowns.
struct FreeMass {
  const MassMatrix& mass;
  const Fixed& fixed;
  void vmult(DealVector& y, const DealVector& x) const {
    Vector from = Eigen::Map<const Vector>(x.begin(), x.size()), to;
    for (std::size_t i = 0; i < fixed.size(); ++i)
      if (fixed[i]) from[static_cast<Eigen::Index>(i)] = 0;
    mass.multiply(from, to);
    for (std::size_t i = 0; i < fixed.size(); ++i)
      y[static_cast<unsigned>(i)] = fixed[i] ? 0.0 : to[static_cast<Eigen::Index>(i)];
  }
};

/// K⁻¹ among the free unknowns.
struct Inverse {
  LinearSolver& solver;
  void vmult(DealVector& y, const DealVector& x) const {
    Vector u;
    solver.solve(Eigen::Map<const Vector>(x.begin(), x.size()), u);
    std::copy(u.begin(), u.end(), y.begin());
  }
};

}  // namespace

std::vector<Mode> natural_modes(const Mesh& mesh, const BlockMatrix& stiffness,
                                const MassMatrix& mass, const Fixed& fixed, std::size_t count,
                                const SolverOptions& options) {
  const auto free = static_cast<std::size_t>(std::count(fixed.begin(), fixed.end(), 0));
  if (4 * count > free)
    throw std::invalid_argument("asks for more modes than a quarter of the free unknowns.");
  auto chosen = choose_solver(stiffness, mesh, fixed, options);
  chosen.solver->prepare();
  const auto vectors = static_cast<unsigned>(std::min(free - 1, 2 * count + 20));
  const auto size = static_cast<unsigned>(fixed.size());
  // With the shift 0 the largest eigenvalues of K⁻¹ M are wanted: those of the lowest frequencies.
  dealii::SolverControl control(1000, 1e-12);
  dealii::ArpackSolver solver(control, dealii::ArpackSolver::AdditionalData(
                                           vectors, dealii::ArpackSolver::largest_magnitude, true));
  DealVector start(size);
  for (unsigned i = 0; i < size; ++i)
    start[i] =
        fixed[i] ? 0.0 : 1.0 + 0.5 * std::sin(7.0 * i);  // of no symmetry, and the same every time
  solver.set_initial_vector(start);
  std::vector<std::complex<double>> values(count);
  std::vector<DealVector> shapes(count, DealVector(size));
  const FreeMass free_mass{mass, fixed};
  try {
    solver.solve(free_mass, free_mass, Inverse{*chosen.solver}, values, shapes,
                 static_cast<unsigned>(count));
  } catch (const std::exception& error) {
    throw std::runtime_error("the natural frequencies were not found: " + first_line(error));
  }
  std::vector<Mode> modes;
  for (std::size_t m = 0; m < count; ++m) {
    Mode mode{std::sqrt(std::max(0.0, values[m].real())) / (2 * std::numbers::pi),
              Eigen::Map<const Vector>(shapes[m].begin(), static_cast<Eigen::Index>(size))};
    Vector product;
    mass.multiply(mode.shape, product);
    mode.shape /= std::sqrt(mode.shape.dot(product));
    modes.push_back(std::move(mode));
  }
  std::sort(modes.begin(), modes.end(),
            [](const Mode& a, const Mode& b) { return a.frequency < b.frequency; });
  return modes;
}

}  // namespace acopla::fem
