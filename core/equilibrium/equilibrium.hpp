#pragma once

#include <diracstep/core/system/scene.hpp>
#include <functional>
#include <string>

namespace diracstep {

/// A point at which a scene rests, or from which it moves on steadily.
struct Equilibrium {
  double time = 0.0;
  Vector q, v;
  Vector lambda;  ///< forces of the rows; of redundant rows the least ones in the Euclidean norm
  int iterations = 0;
  std::string failure = {};  ///< empty, or why none was found, with the equation that is left

  bool ok() const { return failure.empty(); }
};

/// The equilibrium that Newton's path leads to from the start's position: q and λ with
///
///   −∂L/∂q − f − A(q)ᵀλ = 0,   φ(q) = 0     at v = 0
///
/// in which the time is that of the start.  Where equilibria are not isolated, as along a coordinate that
/// nothing depends on or under nonholonomic rows, q moves as little as it must (Euclidean norm), and forces
/// of rows come before changes of q.  Nonholonomic rows with constant coefficients, as Kirchhoff's laws, keep
/// A q as it is at the start.
///
/// `along_start` looks for a steady motion q + v t instead: coordinates with a velocity at the start keep
/// moving, the others are at rest, and
///
///   (∂²L/∂v∂q) v + ∂²L/∂v∂t − ∂L/∂q − f − A(q)ᵀλ = 0,   φ(q) = 0,   A(q) v + b(q) = 0.
///
/// Velocities change from those of the start only as far as the rows ask for it.  It is steady where nothing
/// depends on the moving coordinates; Linearisation::variation tells.
///
/// On a group the equations are left-trivialised and q moves by q τ(x); equilibria at rest alone, and with
/// full matrices.
///
/// Damped by following Newton's path: a step counts when the residual there is what the path predicts.
/// Matrices are full up to 2000 coordinates and rows.  Beyond, they are sparse, all rows must be on positions
/// and independent, the equilibrium isolated, and it cannot be asked for along_start.  `go_on`, where there
/// is one, is asked before each evaluation; false ends the search with the failure "interrupted".  Throws
/// Misuse, and what completed() throws.
Equilibrium find_equilibrium(const Scene& scene, const Start& start, bool along_start = false,
                             const std::function<bool()>& go_on = {});

/// Whether a scene is too large for full matrices.
bool needs_sparse_matrices(const Scene& scene);

}  // namespace diracstep
