#pragma once

#include <string>

namespace diracstep {

/// When Newton's method takes a new Jacobian.  A Jacobian that the problem declares constant is factored once
/// for each value of its parameter, whatever is asked for except `fresh`.
enum class JacobianPolicy {
  automatic,  ///< fresh for up to 200 entries and 11 for each unknown, as a full matrix of 11 has; else kept
  fresh,      ///< in every iteration
  per_step,   ///< in the first iteration of a solve, and where the residual then falls too slowly
  kept,       ///< only where the residual falls too slowly, so that one serves many steps
};

/// What is repeated until the residual is zero.
enum class Iteration {
  newton,
  fixed_point,  ///< x ← x − P⁻¹F(x) by KINSOL's fixed-point solver with the problem's splitting P; Newton's
                ///< method where there is none or it does not converge
  automatic,  ///< fixed-point while a solve takes no more than six iterations, which is what two of
              ///< Newton's method cost, then Newton's method
};

/// Settings of the iteration; the defaults solve a step to round-off.
///
/// A residual row counts as zero below `tolerance` times the scale of its block.  Where round-off keeps it
/// above, a Newton step below `step_tolerance` of the unknowns ends the iteration, and the solution is
/// accepted if the residual is below `accept` times the scale; anything else is a failure.
struct KinsolOptions {
  double tolerance = 1e-15;
  double step_tolerance = 1e-9;
  double accept = 1e-11;
  int max_iterations = 20;
  JacobianPolicy jacobian = JacobianPolicy::automatic;
  Iteration iteration = Iteration::newton;
  int anderson = 0;  ///< how many past iterates accelerate the fixed-point iteration
};

/// The name as a user writes it: "automatic", "per-step", …
const char* name(JacobianPolicy policy);
/// The policy of that name; throws Misuse for any other.
JacobianPolicy jacobian_policy(const std::string& name);
/// The name as a user writes it: "newton", "fixed-point", "automatic".
const char* name(Iteration iteration);
/// The iteration of that name; throws Misuse for any other.
Iteration iteration(const std::string& name);

}  // namespace diracstep
