// How far a system magnifies the rounding of its numbers.
#pragma once

#include <functional>

#include "fem/supports.h"

namespace acopla::fem {

using LinearMap = std::function<void(const Vector& x, Vector& result)>;

/// Condition number κ = λ_max / λ_min of a symmetric positive matrix at its free unknowns, by Lanczos' method on the matrix and on
/// its inverse (Golub & Van Loan, Matrix Computations, ch. 10). An estimate from below, of a few per cent.
/// @param multiply  result = A x; entries of held unknowns are not read
/// @param solve     result = A⁻¹ x at free unknowns
double condition_number(const LinearMap& multiply, const LinearMap& solve, const Fixed& fixed);

}  // namespace acopla::fem
