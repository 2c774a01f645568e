// The matrices of a structure and the systems made of them, wherever their rows are kept.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "fem/block_matrix.h"
#include "fem/linear_solver.h"

namespace acopla::fem {

/// Stiffness K and mass M of one structure. Analyses see whole nodal vectors; the rows are on this process (LocalMatrices) or
/// shared out among several (distributed/distributed_matrices.h).
class Matrices {
 public:
  virtual ~Matrices() = default;
  virtual int dimension() const = 0;
  virtual double norm() const = 0;  ///< largest sum of magnitudes of a row of K
  virtual void stiffness(const Vector& x, Vector& result) const = 0;  ///< result = K x
  virtual void mass(const Vector& x, Vector& result) const = 0;       ///< result = M x
  /// The same in the rows of these nodes; other entries of `result` stay.
  virtual void stiffness(const Vector& x, std::span<const std::uint32_t> nodes, Vector& result) const = 0;
  virtual void mass(const Vector& x, std::span<const std::uint32_t> nodes, Vector& result) const = 0;
  /// For systems of k K + m M at free unknowns. These matrices must outlive it.
  virtual ChosenSolver solver(double k, double m, const SolverOptions& options) const = 0;
  /// 1/(M⁻¹)_nn of each node, as MassMatrix::sudden [kg]
  virtual std::vector<double> sudden(std::span<const std::uint32_t> nodes) const = 0;
};

class LocalMatrices : public Matrices {
 public:
  /// @param mass  may be null: a static structure has none. All must outlive this.
  LocalMatrices(const Mesh& mesh, const Fixed& fixed, const BlockMatrix& stiffness, const MassMatrix* mass = nullptr)
      : mesh_(mesh), fixed_(fixed), stiffness_(stiffness), mass_(mass) {}

  int dimension() const override { return stiffness_.dimension(); }
  double norm() const override { return stiffness_.norm(); }
  void stiffness(const Vector& x, Vector& result) const override { stiffness_.multiply(x, result); }
  void mass(const Vector& x, Vector& result) const override { mass_->multiply(x, result); }
  void stiffness(const Vector& x, std::span<const std::uint32_t> nodes, Vector& result) const override { stiffness_.multiply(x, nodes, result); }
  void mass(const Vector& x, std::span<const std::uint32_t> nodes, Vector& result) const override { mass_->multiply(x, nodes, result); }
  ChosenSolver solver(double k, double m, const SolverOptions& options) const override;
  std::vector<double> sudden(std::span<const std::uint32_t> nodes) const override;

 private:
  const Mesh& mesh_;
  const Fixed& fixed_;
  const BlockMatrix& stiffness_;
  const MassMatrix* mass_;
};

}  // namespace acopla::fem
