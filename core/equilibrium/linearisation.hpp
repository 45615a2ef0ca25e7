#pragma once

#include <diracstep/core/equilibrium/equilibrium.hpp>

namespace diracstep {

/// The linear equations of small motions about an equilibrium or a steady motion,
///
///   M δa + C δv + K δq = Aᵀ δλ,   A_h δq = 0,   A_n δv + D δq = 0,
///
/// with M = ∂²L/∂v², C = ∂²L/∂v∂q − ∂²L/∂q∂v − ∂f/∂v, K = −∂²L/∂q² − ∂f/∂q − ∂(Aᵀλ)/∂q and
/// D = ∂(A_n v + b)/∂q, for rows on positions A_h and the others A_n, those that a degenerate Lagrangian
/// hides included (hidden_rows.hpp).  Exact derivatives; third derivatives of L enter only along motions that
/// are not steady.
///
/// Reduced to the true degrees of freedom by  δq = N y,  δv = S u + P y,  with orthonormal columns N of ker
/// A_h and S of ker A: nonholonomic rows leave more positions y than velocities u.
struct Linearisation {
  Columns positions;   ///< N, n × (n − rank A_h); the identity where there are no holonomic rows
  Columns velocities;  ///< S, n × (n − rank A)
  Columns drift;       ///< P, the velocities that a change of position brings with it; 0 at rest

  Columns mass;       ///< Sᵀ M S
  Columns damping;    ///< Sᵀ C S: gyroscopic terms are in its antisymmetric part
  Columns stiffness;  ///< Sᵀ K N, 0 where it is round-off
  /// What round-off may make of each entry of that: of forces of rows that cancel, and of a position that is
  /// known to so many digits.
  Columns stiffness_round_off;

  /// d/dt (y, u) = state (y, u); d/dt y = state y where all of M vanishes, as for phase-space
  /// Lagrangians, and where rows leave no u.
  Columns state;
  /// All terms symmetric and none in u: motions M ü + K u = 0.
  bool conservative = false;

  int rows = 0, redundant_rows = 0;
  /// How much M, C, K, A and the equations of equilibrium change along the motion, relative to their size.
  double variation = 0.0;
};

/// About `at`, comparing its matrices with those `later` on, where only a steady motion of a scene without
/// time in it has the same.  Throws Misuse where M is singular on the rows.
Linearisation linearise(const Scene& scene, const Equilibrium& at, double later);

}  // namespace diracstep
