#pragma once

#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <diracstep/core/system/scene.hpp>
#include <string>
#include <vector>

namespace diracstep {

/// Which components of a start are guesses, which projection may move; the others are given and stay.  An
/// empty list stands for all.
struct Guesses {
  std::vector<bool> q, v;
};

/// A start moved onto the constraints, and how far it had to move (Euclidean norms).
struct ProjectedStart {
  Start start;
  double position_moved = 0.0;
  double velocity_moved = 0.0;
};

/// The nearest start on the constraints: q is the point of φ(t,q) = 0 nearest to the given one in the
/// Euclidean norm, then v the velocity of the affine distribution nearest to the given one in the norm of
/// ∂²L/∂v² (for a degenerate Lagrangian: of any solution of  ∂L/∂v(q,v) − Aᵀμ = ∂L/∂v(q,v̂),  A v + b = 0);
/// both among those that differ in `guesses` alone.
/// Where the equations of motion hide some that hold velocities (kernel_motions.hpp), q and v move together
/// onto these and all rows by the least changes. The rows that a degenerate Lagrangian hides count as rows
/// (hidden_rows.hpp), and the velocities that carry no momentum are set by them, given or not.  A start with
/// a momentum in place of v is given its velocity first. Throws Misuse where no such point is found, with the
/// row that is not met.
ProjectedStart project_start(const Scene& scene, const Start& start, const SolverFactory& solvers,
                             const Guesses& guesses = {});

/// "b from 0.1745 to 0.1148, v_c from 0 to 0.2": what differs, the largest changes first, at most eight.
std::string describe_moves(const Scene& scene, const Start& from, const Start& to);

}  // namespace diracstep
