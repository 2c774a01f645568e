// Sparse Cholesky factors of a stiffness (CHOLMOD).
#pragma once

#include <memory>

#include "fem/block_matrix.h"
#include "fem/supports.h"

namespace acopla::fem {

/// K = L Lᵀ of the free unknowns. Cholesky rather than UMFPACK's LU: half the memory and a quarter
/// of the work for a symmetric matrix, and the analysis alone gives the exact size of the factor.
class Cholesky {
 public:
  /// Orders the unknowns and finds the pattern of the factor; computes no number of it.
  /// The matrix must outlive factor().
  Cholesky(const BlockMatrix& matrix, const Fixed& fixed);
  ~Cholesky();
  Cholesky(Cholesky&&) noexcept;

  /// Memory of the factor and of its updates. While factor() runs, the lower triangle of the matrix
  /// comes on top, at 16 bytes an entry.
  double bytes() const;
  double flops() const;  ///< multiplications and additions of the factorisation

  /// @throws io::UserError naming the place when a mechanism is left in the structure, i.e. the
  /// matrix is singular; std::runtime_error when memory runs out.
  /// @param points  position of each node [m], for the message
  void factor(const std::vector<Vec3>& points);
  /// x = K⁻¹ b at free unknowns, 0 at held ones.
  void solve(const Vector& b, Vector& x);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Multiplications and additions a second [1/s] in a product of 400 × 400 with the BLAS of
/// factor(): OpenBLAS where it is installed, else the reference one, twenty times slower.
double blas_rate();

}  // namespace acopla::fem
