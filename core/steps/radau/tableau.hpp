#pragma once

#include <diracstep/core/numerics/types.hpp>

namespace diracstep {

/// Radau IIA with s stages on [0,1]: collocation at the zeros c_i of P_s − P_{s−1}, the last of them 1, so
/// that its weights are the last row of a_ij = ∫_0^{c_i} l_j.  Computed in extended precision and rounded
/// once (Hairer, Wanner, Solving Ordinary Differential Equations II, IV.5).
struct RadauTableau {
  Vector c;
  Columns a;
};

/// The most stages of a step that is offered, of order 9.
inline constexpr int most_radau_stages = 5;

/// Throws Misuse unless 1 ≤ s ≤ most_radau_stages.
RadauTableau radau_tableau(int s);

}  // namespace diracstep
