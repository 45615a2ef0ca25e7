#pragma once

#include <complex>
#include <diracstep/core/integrator/integrator_options.hpp>
#include <diracstep/core/methods/registry.hpp>
#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <diracstep/core/system/scene.hpp>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace diracstep {

/// Linear conditions on both ends of a motion, with q, v and p = ∂L/∂v, v on the rows, at each:
///
///   at_start · (q0, v0, p0) + at_end · (qN, vN, pN) = value
///
/// `at_start` and `at_end` have a line for each condition and 3n columns.  A motion of n coordinates with m
/// rows, m_h of them holonomic, is determined by 2n − m − m_h conditions; that of a Lagrangian linear in v by
/// n, none of them on v.
struct BoundaryConditions {
  Columns at_start, at_end;
  Vector value;

  /// The first n conditions are q0 = …; the last n are qN = ….  A place held on m_h holonomic rows counts for
  /// n − m_h conditions.
  bool start_held = false, end_held = false;
  /// Solutions come in families, or conditions follow from others, as those of periodic orbits do: the
  /// solution near the guess is found in least squares, and any number of conditions may be given.
  bool families = false;
};

/// Both places given; from a start to conditions at the end; and q, v at the end as at the start.
BoundaryConditions between(ConstVectorRef q0, ConstVectorRef qN);
BoundaryConditions periodic(int n);

/// Where a motion is guessed to be at time t; the velocity as far as it is known.
struct GuessedPoint {
  Vector q, v;
};
using GuessedMotion = std::function<GuessedPoint(double t)>;

/// On a straight line from one place to another.
GuessedMotion straight_line(double t0, ConstVectorRef q0, double tN, ConstVectorRef qN);

/// So many steps of the size in the options from the start time of the scene on; the rest of its start is not
/// looked at.
struct BoundaryProblem {
  std::shared_ptr<const Scene> scene;
  const Registry& registry;
  SolverFactory solvers;
  IntegratorOptions options;
  long steps;
  BoundaryConditions conditions;
  GuessedMotion guess;
  int max_iterations = 60;
  std::function<bool()> go_on = {};  ///< asked before each iteration; false ends the search where it is
};

/// Jacobi's solution of the discrete Hamilton-Jacobi equation (Ohsawa, Bloch, Leok, SIAM J. Control Optim.
/// 49, 2011, arXiv 0911.2258): the action S^N(q0, qN) = Σ L_d along the motion between the two.
struct DiscreteAction {
  double value;
  Vector gradient;  ///< (∂S/∂q0, ∂S/∂qN) = (−p0, pN), along what the rows allow
  /// By (q0, qN), symmetric to round-off; empty with rows, on whose places a second derivative is no matrix,
  /// and where qN is conjugate to q0.
  Columns hessian;
};

struct [[nodiscard]] BoundaryReport {
  bool converged = false;
  std::string ending;       ///< how the search ended, and where it did not converge, what may help
  int iterations = 0;       ///< Newton's, each with one factorisation
  double correction = 0.0;  ///< the last one, in parts of the largest number of its kind
  double residual = 0.0;    ///< of the conditions, largest entry
  /// Empty, or why the motion is not to be believed though it solves the equations: its energy changes
  /// (EnergyCheck), or a run takes another step from one of its points, as where steps are too large.
  std::string doubt;

  /// At the ends of all steps, 0 … N: a column for each, p projected.
  Vector times;
  Columns q, v, p;

  std::optional<DiscreteAction> action;
  std::string no_action;  ///< why there is none

  /// With `families`: how many directions the conditions leave free, and the eigenvalues of the derivative of
  /// the end (qN, vN) by the start along the rows, largest first: Floquet's multipliers of a periodic orbit.
  int free_directions = 0;
  std::vector<std::complex<double>> multipliers;
};

/// All steps as one sparse system for Newton's method with damping by the natural monotonicity test
/// (Deuflhard, Newton Methods for Nonlinear Problems, 2004), each iteration one factorisation by KLU: with
/// x_k the unknowns of step k, F(x_k; z_k) = 0, z_{k+1} = G(x_k; z_k), and the conditions.
///
/// Takes every method that Sensitivities take.  Throws Misuse where the conditions are not as many as the
/// motion needs: with nonholonomic rows the motions from one place reach n − m dimensions of the places that
/// the rows connect, so that q0 and qN cannot both be prescribed; for places off holonomic rows; and where
/// Sensitivities do.  A search that does not converge is told in the report, with its last iterate.
BoundaryReport solve_boundary_values(const BoundaryProblem& problem);

}  // namespace diracstep
