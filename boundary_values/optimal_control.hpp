#pragma once

#include <diracstep/boundary_values/boundary_values.hpp>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace diracstep {

/// A scene whose force depends on controls u, P numbers that are chosen at each time, and what they cost:
///
///   ∫ ℓ(t, q, v, u) dt + Φ(t, q, v) at the end
struct ControlledScene {
  std::shared_ptr<const Scene> scene;  ///< of n coordinates; its own force is not looked at
  std::vector<std::string> controls;   ///< their names
  /// All of the force, a function of n + P coordinates (q, u) whose first n components are taken; the
  /// velocities of u are zero.
  std::shared_ptr<const Force> force;
  /// ℓ and Φ as functions of n + P coordinates (q, u) and (v, 0); Φ does not read u.  Null: none.
  std::shared_ptr<const Lagrangian> cost = {}, end_cost = {};
  Vector lower = {}, upper = {};  ///< bounds of u, P numbers, infinite where there are none; empty: all free
  /// Where the force and ℓ are not smooth, as functions of (q, v) with any u; null: as the scene has it.
  std::shared_ptr<const Kinks> kinks = {};
};

/// So many steps of the size in the options from the start time of the scene on.  The conditions on the ends
/// may be any number, those on q, v and p of BoundaryConditions; conditions that follow from the rows and
/// from those before them are left out.
struct ControlProblem {
  ControlledScene controlled;
  const Registry& registry;
  SolverFactory solvers;
  IntegratorOptions options;
  long steps;
  BoundaryConditions conditions;
  GuessedMotion guess;
  Vector guessed_controls = {};  ///< the same at all times; empty: zero, moved between the bounds
  /// On each step u is a polynomial in t of this degree, of its own; it is given by its values at the Lobatto
  /// points of the step, the ends for degree 1, where its bounds hold.  More than s − 1 are not determined by
  /// a step with s points.
  int degree = 0;
  Vector lower_q = {}, upper_q = {};  ///< bounds of q at the ends of the steps; empty: none
  int max_iterations = 500;
  double tolerance = 1e-9;           ///< of the optimality conditions, scaled as Ipopt scales them
  std::function<bool()> go_on = {};  ///< asked after each iteration; false ends the search
};

constexpr long most_control_steps = 100'000;

struct [[nodiscard]] OptimalControlReport {
  bool converged = false;
  bool interrupted = false;  ///< by go_on
  std::string ending;
  int iterations = 0;
  double cost = 0.0;
  double residual = 0.0;  ///< of the steps, the rows and the conditions, largest entry
  /// How far from the end, in q and p, the steps end that the integrator takes from the start with these
  /// controls: NaN where they fail.
  double end_of_run = 0.0;
  /// Empty, or why the controls are not to be believed though the search has converged: a run with them ends
  /// elsewhere.
  std::string doubt;

  /// At the ends of all steps, 0 … N: a column for each; v and p on the rows.
  Vector times;
  Columns q, v, p;
  Vector control_times;  ///< with degree 0 the middle of each step
  Columns controls;      ///< P numbers in each column
};

/// Whether this library was built with Ipopt.
bool optimal_control_available();

/// The controls that cost least, where the residual of every step is a constraint: the transcription of
/// discrete mechanics and optimal control (Ober-Blöbaum, Junge, Marsden, ESAIM: COCV 17, 2011, arXiv
/// 0810.1386), here for every method and class that Sensitivities take, nonholonomic rows among them
/// (Kobilarov, Marsden, Sukhatme, Discrete Contin. Dyn. Syst. S 3, 2010).
///
///   min p_c(N) + Φ(q_N, v_N)   over x_k, z_k, u_k,    F(x_k; z_k, u_k) = 0,  z_{k+1} = G(x_k; z_k, u_k)
///
/// with the equations of the ends as solve_boundary_values() has them, and bounds on u and q.  The integral
/// is the momentum p_c of one more coordinate of unit mass on which ℓ is the force, so that it has the
/// quadrature of the method.  Gradients and the sparse Jacobian are exact, from the derivatives of the steps;
/// the Hessian of Lagrange's function, one block for each step, is a difference of these.  Solved by Ipopt,
/// an interior-point method (Wächter, Biegler, Math. Program. 106, 2006): a local minimum near the guess.
///
/// Steps are divided at times at which formulas jump or have kinks whatever the motion, as those of a run
/// are, but not where the motion crosses a kink in q or v: end_of_run, of a run that divides there, tells.
/// Throws Misuse without Ipopt, for sizes that disagree, for Lagrangians linear in v, and where
/// solve_boundary_values() does.
OptimalControlReport solve_optimal_control(const ControlProblem& problem);

}  // namespace diracstep
