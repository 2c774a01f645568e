// deal.II's conjugate gradients with Trilinos ML.
#include <deal.II/lac/solver_cg.h>
#include <deal.II/lac/trilinos_precondition.h>
#include <deal.II/lac/trilinos_sparse_matrix.h>
#include <deal.II/lac/vector.h>
#include <mpi.h>

#include <Epetra_MultiVector.h>
#include <Eigen/Geometry>
#include <Teuchos_ParameterList.hpp>

#include <cstdlib>
#include <stdexcept>

#include "fem/dealii_error.h"
#include "fem/linear_solver.h"

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
  std::vector<unsigned> entries(3 * matrix.nodes());
  for (std::size_t n = 0; n < matrix.nodes(); ++n)
    for (std::size_t d = 0; d < 3; ++d)
      entries[3 * n + d] = fixed[3 * n + d] ? 1 : static_cast<unsigned>(3 * matrix.row(n).size());
  const auto size = static_cast<dealii::types::global_dof_index>(entries.size());
  auto result = std::make_unique<TrilinosMatrix>(size, size, entries);
  std::vector<dealii::types::global_dof_index> columns;
  std::vector<double> values;
  for (std::size_t i = 0; i < entries.size(); ++i) {
    columns.clear();
    values.clear();
    const auto row = matrix.row(i / 3);
    for (std::size_t k = 0; k < row.size(); ++k)
      for (std::size_t d = 0; d < 3; ++d) {
        const auto j = 3 * std::size_t{row[k]} + d;
        if (i != j && (fixed[i] || fixed[j])) continue;
        columns.push_back(static_cast<dealii::types::global_dof_index>(j));
        values.push_back(matrix.block(i / 3, k)[3 * (i % 3) + d]);
      }
    result->set(static_cast<dealii::types::global_dof_index>(i), columns, values);
  }
  result->compress(dealii::VectorOperation::insert);
  return result;
}

/// The six rigid-body modes at the free unknowns, mode after mode.
std::vector<double> rigid_modes(const Mesh& mesh, const Fixed& fixed) {
  const auto size = fixed.size();
  std::vector<double> modes(6 * size, 0.0);
  Vec3 centre = Vec3::Zero();
  for (const auto& p : mesh.points()) centre += p / static_cast<double>(mesh.nodes());
  for (std::size_t n = 0; n < mesh.nodes(); ++n)
    for (int axis = 0; axis < 3; ++axis) {
      const Vec3 turn = Vec3(Vec3::Unit(axis)).cross(mesh.points()[n] - centre);
      for (int d = 0; d < 3; ++d) {
        const auto i = 3 * n + static_cast<std::size_t>(d);
        if (fixed[i]) continue;
        modes[static_cast<std::size_t>(axis) * size + i] = d == axis ? 1.0 : 0.0;
        modes[static_cast<std::size_t>(3 + axis) * size + i] = turn[d];
      }
    }
  return modes;
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
    modes_ = rigid_modes(mesh_, fixed_);
    // deal.II 9.4 passes on constant modes only; ML's own list takes the turns as well.
    dealii::TrilinosWrappers::PreconditionAMG::AdditionalData data;
    data.elliptic = true;
    data.aggregation_threshold = 0.02;
    Teuchos::ParameterList list;
    std::unique_ptr<Epetra_MultiVector> unused;
    data.set_parameters(list, unused, *copy_);
    list.set("PDE equations", 3);
    list.set("null space: type", "pre-computed");
    list.set("null space: dimension", 6);
    list.set("null space: vectors", modes_.data());
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
    if (norm > 0) iterate(right, norm, x);
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
