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

int rigid_mode_count(int dimension) { return dimension == 2 ? 3 : 6; }

/// The rigid-body modes at the free unknowns, mode after mode: moves, then turns (about z in 2D).
std::vector<double> rigid_modes(const Mesh& mesh, const Fixed& fixed) {
  const int dimension = mesh.dimension();
  const auto size = fixed.size();
  std::vector<double> modes(static_cast<std::size_t>(rigid_mode_count(dimension)) * size, 0.0);
  Vec3 centre = Vec3::Zero();
  for (const auto& p : mesh.points()) centre += p / static_cast<double>(mesh.nodes());
  for (std::size_t n = 0; n < mesh.nodes(); ++n)
    for (int d = 0; d < dimension; ++d) {
      const auto i = static_cast<std::size_t>(dimension) * n + static_cast<std::size_t>(d);
      if (fixed[i]) continue;
      auto mode = static_cast<std::size_t>(d);
      modes[mode * size + i] = 1;
      mode = static_cast<std::size_t>(dimension);
      for (int axis = dimension == 2 ? 2 : 0; axis < 3; ++axis)
        modes[mode++ * size + i] = Vec3(Vec3::Unit(axis)).cross(mesh.points()[n] - centre)[d];
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
    list.set("PDE equations", mesh_.dimension());
    list.set("null space: type", "pre-computed");
    list.set("null space: dimension", rigid_mode_count(mesh_.dimension()));
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
