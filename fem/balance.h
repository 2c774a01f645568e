// What tells a mechanism from a structure where iterations, which meet no pivot, solve its equations.
#pragma once

#include <fmt/format.h>

#include "io/error.h"

namespace acopla::fem {

/// Conjugate gradients converge on a singular matrix, too: to displacements so large that the rounding of K u is of the load's size, and
/// nothing balances it.
/// @param residual, load  largest entries of f − K u, computed from u and not by the recursion, and of f at free unknowns [N]
/// @param displacement  largest entry of u [m]
/// @throws io::UserError when more than a thousandth of the load is without balance, or a value is no number
inline void check_balance(double residual, double load, double displacement) {
  constexpr double no_balance = 1e-3;
  if (const double left = residual / load; !(left < no_balance))
    throw io::UserError(fmt::format("the structure is a mechanism, or nearly: displacements of {:.2g} m leave {:.2g} of the load without balance. Hold or join the part that "
                                    "moves; one process with linear_solver = \"direct\" names the place.", displacement, left));
}

}  // namespace acopla::fem
