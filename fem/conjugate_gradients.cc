// deal.II's conjugate gradients with Trilinos ML.
#include <deal.II/lac/solver_cg.h>
#include <deal.II/lac/trilinos_precondition.h>
#include <deal.II/lac/trilinos_sparse_matrix.h>
#include <deal.II/lac/vector.h>
#include <mpi.h>

#include <Epetra_MultiVector.h>
#include <Teuchos_ParameterList.hpp>

#include <cstdlib>
#include <numeric>
#include <stdexcept>

#include "fem/balance.h"
#include "fem/dealii_error.h"
#include "fem/linear_solver.h"
#include "fem/rigid_modes.h"

namespace acopla::fem {
namespace {

using DealVector = dealii::Vector<double>;
using TrilinosMatrix = dealii::TrilinosWrappers::SparseMatrix;

/// Trilinos speaks MPI even on one process. Starting MPI costs 0.4 s and a few threads, so that
/// only a structure that iterates pays for it; MPI can be started once a process, and ends with it.
void start_mpi() {
  int started = 0;
  MPI_Initialized(&started);
  if (started) return;
  MPI_Init(nullptr, nullptr);
  std::atexit([] {
    int ended = 0;
    MPI_Finalized(&ended);
    if (!ended) MPI_Finalize();
  });
}

/// The matrix with held rows and columns replaced by their diagonal.
std::unique_ptr<TrilinosMatrix> copy_supported(const BlockMatrix& matrix, const Fixed& fixed) {
  const auto dimension = static_cast<std::size_t>(matrix.dimension());
  std::vector<unsigned> entries(dimension * matrix.nodes());
  for (std::size_t n = 0; n < matrix.nodes(); ++n)
    for (std::size_t d = 0; d < dimension; ++d)
      entries[dimension * n + d] =
          fixed[dimension * n + d] ? 1 : static_cast<unsigned>(dimension * matrix.row(n).size());
  const auto size = static_cast<dealii::types::global_dof_index>(entries.size());
  auto result = std::make_unique<TrilinosMatrix>(size, size, entries);
  std::vector<dealii::types::global_dof_index> columns;
  std::vector<double> values;
  for (std::size_t i = 0; i < entries.size(); ++i) {
    columns.clear();
    values.clear();
    const auto row = matrix.row(i / dimension);
    for (std::size_t k = 0; k < row.size(); ++k)
      for (std::size_t d = 0; d < dimension; ++d) {
        const auto j = dimension * std::size_t{row[k]} + d;
        if (i != j && (fixed[i] || fixed[j])) continue;
        columns.push_back(static_cast<dealii::types::global_dof_index>(j));
        values.push_back(matrix.block(i / dimension, k)[dimension * (i % dimension) + d]);
      }
    result->set(static_cast<dealii::types::global_dof_index>(i), columns, values);
  }
  result->compress(dealii::VectorOperation::insert);
  return result;
}

/// y = K x among the free unknowns.
struct FreeOperator {
  const BlockMatrix& matrix;
  const Fixed& fixed;
  void vmult(DealVector& y, const DealVector& x) const {
    const Vector from = Eigen::Map<const Vector>(x.begin(), x.size());
    Vector to;
    matrix.multiply(from, to);
    for (std::size_t i = 0; i < fixed.size(); ++i)
      y[static_cast<unsigned>(i)] = fixed[i] ? 0.0 : to[static_cast<Eigen::Index>(i)];
  }
};

class ConjugateGradients : public LinearSolver {
 public:
  ConjugateGradients(const BlockMatrix& matrix, const Mesh& mesh, const Fixed& fixed,
                     double tolerance)
      : matrix_(matrix), mesh_(mesh), fixed_(fixed), tolerance_(tolerance) {}

  void prepare() override {
    start_mpi();
    copy_ = copy_supported(matrix_, fixed_);
    std::vector<std::uint32_t> nodes(mesh_.nodes());
    std::iota(nodes.begin(), nodes.end(), 0u);
    modes_ = rigid_modes(mesh_, nodes, fixed_);
    dealii::TrilinosWrappers::PreconditionAMG::AdditionalData data;
    data.elliptic = true;
    data.aggregation_threshold = 0.02;
    Teuchos::ParameterList list;
    std::unique_ptr<Epetra_MultiVector> unused;
    data.set_parameters(list, unused, *copy_);
    set_rigid_modes(list, mesh_.dimension(), modes_);
    multigrid_ = std::make_unique<dealii::TrilinosWrappers::PreconditionAMG>();
    multigrid_->initialize(*copy_, list);
  }

  void solve(const Vector& f, Vector& u) override {
    const auto size = static_cast<unsigned>(fixed_.size());
    DealVector right(size), x(size);
    for (unsigned i = 0; i < size; ++i)
      if (!fixed_[i]) {
        right[i] = f[i];
        if (u.size() == f.size()) x[i] = u[i];
      }
    const double norm = right.l2_norm();
    if (norm > 0) {
      iterate(right, norm, x);
      DealVector residual(size);
      FreeOperator{matrix_, fixed_}.vmult(residual, x);
      residual -= right;
      check_balance(residual.linfty_norm(), right.linfty_norm(), x.linfty_norm());
    }
    u = Vector::Zero(f.size());
    if (norm > 0)
      for (unsigned i = 0; i < size; ++i) u[i] = x[i];
  }

 private:
  void iterate(const DealVector& right, double norm, DealVector& x) {
    constexpr unsigned most = 5000;
    dealii::SolverControl control(most, tolerance_ * norm, false, false);
    try {
      dealii::SolverCG<DealVector>(control).solve(FreeOperator{matrix_, fixed_}, x, right,
                                                  *multigrid_);
    } catch (const dealii::SolverControl::NoConvergence& error) {
      throw std::runtime_error(
          "conjugate gradients did not converge: relative residual " +
          std::to_string(error.last_residual / norm) + " after " + std::to_string(error.last_step) +
          " iterations. Use linear_solver = \"direct\", or a larger `tolerance`.");
    } catch (const std::exception& error) {
      throw std::runtime_error("conjugate gradients failed: " + first_line(error));
    }
  }

  const BlockMatrix& matrix_;
  const Mesh& mesh_;
  const Fixed& fixed_;
  double tolerance_;
  std::unique_ptr<TrilinosMatrix> copy_;
  std::vector<double> modes_;  // ML keeps the pointer
  // Even an empty one calls MPI, so that it is made after MPI has started.
  std::unique_ptr<dealii::TrilinosWrappers::PreconditionAMG> multigrid_;
};

}  // namespace

std::unique_ptr<LinearSolver> make_conjugate_gradients(const BlockMatrix& matrix, const Mesh& mesh,
                                                       const Fixed& fixed, double tolerance) {
  return std::make_unique<ConjugateGradients>(matrix, mesh, fixed, tolerance);
}

}  // namespace acopla::fem
