// The matrices of a structure, shared out among the processes of a team.
#pragma once

#include "fem/distributed/team.h"
#include "fem/matrices.h"
#include "fem/model.h"

namespace acopla::fem {

class Share;

/// For the first process of a team: the matrices of a model, each process with its own rows. Nodal vectors are whole, and this process's alone.
class DistributedMatrices : public Matrices {
 public:
  /// Has every process of the team read the case, make its share, and assemble it. All given must outlive this.
  DistributedMatrices(Team& team, const Settings& settings, const Model& model, bool with_mass);
  ~DistributedMatrices() override;

  int dimension() const override { return model_.mesh.dimension(); }
  double norm() const override;
  void stiffness(const Vector& x, Vector& result) const override;
  void mass(const Vector& x, Vector& result) const override;
  void stiffness(const Vector& x, std::span<const std::uint32_t> nodes, Vector& result) const override;
  void mass(const Vector& x, std::span<const std::uint32_t> nodes, Vector& result) const override;
  ChosenSolver solver(double k, double m, const SolverOptions& options) const override;
  std::vector<double> sudden(std::span<const std::uint32_t> nodes) const override;

 private:
  class Solver;
  Team& team_;
  const Settings& settings_;
  const Model& model_;
  std::unique_ptr<Share> share_;
  mutable std::int64_t solvers_ = 0;  // made so far: the name of the next
};

/// Peak memory of the processes [bytes]: the largest and the sum. For the first process.
struct Memory {
  double largest = 0, sum = 0;
};
Memory peak_memory(Team& team);

/// What the other processes do until the first has ended: serves DistributedMatrices.
void serve_matrices(Team& team);

/// @throws io::UserError, located, when a structure asks for what one process does alone
void refuse_unshared(const Settings& settings);

}  // namespace acopla::fem
