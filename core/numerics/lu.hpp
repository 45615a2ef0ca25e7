#pragma once

#include <Eigen/LU>
#include <diracstep/core/numerics/types.hpp>

namespace diracstep {

/// x = M⁻¹ b with the factors of M, one column or several.  x has its size already and is not b: then nothing
/// is allocated, which solve() of the factors does.
template <class Right, class Left>
void solve_into(const Eigen::PartialPivLU<Columns>& factors, const Right& b, Left& x) {
  x.noalias() = factors.permutationP() * b;
  factors.matrixLU().triangularView<Eigen::UnitLower>().solveInPlace(x);
  factors.matrixLU().triangularView<Eigen::Upper>().solveInPlace(x);
}

}  // namespace diracstep
