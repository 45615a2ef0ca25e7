#pragma once

#include <array>
#include <diracstep/core/system/constraint_distribution.hpp>
#include <vector>

namespace diracstep {

using RowKinds =
    std::array<std::vector<int>, 2>;  ///< ascending numbers of the holonomic rows, and of the others

/// Numbers of the rows of A(t,q) that are combinations of the others to within `tolerance`, by sparse
/// products: to within 1e-6 at best.  A holonomic one is among them only where holonomic ones alone make it
/// redundant. Throws Misuse where the products would be too many.
std::vector<int> dependent_sparse_rows(const ConstraintsAtPoint& rows, const RowKinds& kinds,
                                       double tolerance);

}  // namespace diracstep
