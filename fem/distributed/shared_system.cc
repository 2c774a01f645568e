#include "fem/distributed/shared_system.h"

#include <deal.II/lac/solver_cg.h>
#include <deal.II/lac/trilinos_precondition.h>
#include <deal.II/lac/trilinos_sparse_matrix.h>
#include <deal.II/lac/trilinos_vector.h>
#include <fmt/format.h>

#include <Epetra_MultiVector.h>
#include <Epetra_FEVector.h>
#include <Teuchos_ParameterList.hpp>

#include <limits>
#include <stdexcept>

#include "fem/balance.h"
#include "fem/block_matrix.h"
#include "fem/dealii_error.h"
#include "fem/distributed/communicators.h"
#include "fem/rigid_modes.h"

namespace acopla::fem {
namespace {

using DistributedVector = dealii::TrilinosWrappers::MPI::Vector;
using Index = dealii::types::global_dof_index;

double* values(DistributedVector& vector) { return vector.trilinos_vector()[0]; }

}  // namespace

struct SharedSystem::State {
  double tolerance, norm = 0;
  std::vector<char> fixed;  // of this process
  dealii::IndexSet rows;
  MPI_Comm communicator;
  std::unique_ptr<dealii::TrilinosWrappers::SparseMatrix> matrix;
  std::vector<double> modes;  // ML keeps the pointer
  dealii::TrilinosWrappers::PreconditionAMG multigrid;

  DistributedVector vector() const { return DistributedVector(rows, communicator); }
  double largest(const DistributedVector& x) const { return x.linfty_norm(); }

  void fill(const Partition& partition, const Mesh& mesh, const Fixed& all_fixed, const BlockMatrix& block, int rank) {
    const auto d = static_cast<std::size_t>(mesh.dimension());
    const auto nodes = partition.nodes(rank);
    std::vector<unsigned> entries;
    for (const auto n : nodes)
      for (std::size_t i = 0; i < d; ++i) {
        fixed.push_back(all_fixed[d * n + i]);
        entries.push_back(fixed.back() ? 1 : static_cast<unsigned>(d * block.row(n).size()));
      }
    matrix = std::make_unique<dealii::TrilinosWrappers::SparseMatrix>(rows, communicator, entries);
    std::vector<Index> columns;
    std::vector<double> row_values;
    for (const auto n : nodes)
      for (std::size_t i = 0; i < d; ++i) {
        columns.clear();
        row_values.clear();
        const auto row = block.row(n);
        for (std::size_t k = 0; k < row.size(); ++k)
          for (std::size_t j = 0; j < d; ++j) {
            const bool diagonal = row[k] == n && i == j;
            if (!diagonal && (all_fixed[d * n + i] || all_fixed[d * row[k] + j])) continue;
            columns.push_back(static_cast<Index>(d * partition.place(row[k]) + j));
            row_values.push_back(block.block(n, k)[d * i + j]);
          }
        matrix->set(static_cast<Index>(d * partition.place(n) + i), columns, row_values);
      }
    matrix->compress(dealii::VectorOperation::insert);
    norm = matrix->linfty_norm();
  }

  void precondition(const Partition& partition, const Mesh& mesh, int rank) {
    modes = rigid_modes(mesh, partition.nodes(rank), fixed);
    dealii::TrilinosWrappers::PreconditionAMG::AdditionalData data;
    data.elliptic = true;
    data.aggregation_threshold = 0.02;
    Teuchos::ParameterList list;
    std::unique_ptr<Epetra_MultiVector> unused;
    data.set_parameters(list, unused, *matrix);
    set_rigid_modes(list, mesh.dimension(), modes);
    multigrid.initialize(*matrix, list);
  }

  void iterate(const DistributedVector& right, double residual, DistributedVector& x) const {
    constexpr unsigned most = 5000;
    dealii::SolverControl control(most, residual, false, false);
    try {
      dealii::SolverCG<DistributedVector>(control).solve(*matrix, x, right, multigrid);
    } catch (const dealii::SolverControl::NoConvergence& error) {
      throw std::runtime_error(fmt::format("conjugate gradients did not converge on several processes: residual {:.3g} after {} iterations, {:.3g} was "
                                           "asked for. Is a part held by a node or an edge alone? One process with linear_solver = \"direct\" names the place.",
                                           error.last_residual, error.last_step, residual));
    } catch (const std::exception& error) {
      throw std::runtime_error("conjugate gradients failed: " + first_line(error));
    }
  }
};

SharedSystem::SharedSystem(Team& team, const Partition& partition, const Mesh& mesh, const Fixed& fixed, const BlockMatrix& matrix, double tolerance)
    : state_(std::make_unique<State>()) {
  auto& s = *state_;
  const auto d = static_cast<Index>(mesh.dimension());
  s.tolerance = tolerance;
  s.communicator = team.communicators().work;
  s.rows.set_size(static_cast<Index>(mesh.unknowns()));
  s.rows.add_range(d * static_cast<Index>(partition.start(team.rank())), d * static_cast<Index>(partition.start(team.rank() + 1)));
  s.fill(partition, mesh, fixed, matrix, team.rank());
  s.precondition(partition, mesh, team.rank());
}

SharedSystem::~SharedSystem() = default;

void SharedSystem::solve(const Vector& f, Vector& u) {
  auto& s = *state_;
  auto right = s.vector(), x = s.vector();
  for (std::size_t i = 0; i < s.fixed.size(); ++i)
    if (!s.fixed[i]) {
      values(right)[i] = f[static_cast<Eigen::Index>(i)];
      values(x)[i] = u[static_cast<Eigen::Index>(i)];
    }
  u.setZero();
  const double norm = right.l2_norm(), load = s.largest(right);
  if (norm == 0) return;
  s.iterate(right, s.tolerance * norm, x);
  // Refinement: what recursive residuals hide is found and solved for again (Higham, Accuracy and Stability of Numerical Algorithms, ch. 12).
  constexpr double rounding = 2 * std::numeric_limits<double>::epsilon();
  constexpr int most = 5;
  constexpr double share = 1e-3;  // of a residual, enough for two or three rounds to reach rounding
  auto residual = s.vector(), correction = s.vector();
  double before = std::numeric_limits<double>::max();
  for (int round = 0; round < most; ++round) {
    s.matrix->residual(residual, x, right);
    const double error = s.largest(residual) / (s.norm * s.largest(x) + load);
    if (error <= rounding || error > before / 2) break;
    before = error;
    correction = 0;
    s.iterate(residual, share * residual.l2_norm(), correction);
    x += correction;
  }
  s.matrix->residual(residual, x, right);
  check_balance(s.largest(residual), load, s.largest(x));
  for (std::size_t i = 0; i < s.fixed.size(); ++i)
    if (!s.fixed[i]) u[static_cast<Eigen::Index>(i)] = values(x)[i];
}

}  // namespace acopla::fem
