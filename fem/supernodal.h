// The numbers of a supernodal Cholesky factor, computed with Eigen's dense kernels.
#pragma once

#include <cholmod.h>

#include <functional>
#include <optional>

namespace acopla::fem {

/// Adds the entries of column `j` (in the factor's order) to `column`, on and below the diagonal.
/// @param local  row of the factor -> its place in `column`
using AddColumn =
    std::function<void(SuiteSparse_long j, const SuiteSparse_long* local, double* column)>;

/// Left-looking supernodal factorisation (Chen et al. 2008, CHOLMOD, algorithm of §2.3) into the
/// structure that cholmod_l_analyze found. CHOLMOD's own calls the system's BLAS, which on a plain
/// Debian is the reference one: 1.5 Gflop/s where these kernels make ten times that.
/// @param factor  symbolic and supernodal on entry, numeric on return
/// @return the first column without a positive pivot, or nothing when there is none
/// @throws std::bad_alloc
std::optional<SuiteSparse_long> factor_supernodes(cholmod_factor& factor, cholmod_common& common,
                                                  const AddColumn& add_column);

}  // namespace acopla::fem
