#pragma once

#include <diracstep/solvers/kinsol_solver.hpp>
#include <string>

namespace diracstep {

/// Solves nonlinear problems by a plain loop, without what a call of KINSOL takes around the arithmetic of a
/// small step, and with the same tolerances: x ← x − P⁻¹F(x) with the problem's splitting P, and Newton's
/// method where there is none, where it does not contract or where the first solves show it to be slow
/// (`options.iteration`).  What this does not solve is solved by kinsol() from the same guess, so that a step
/// that fails fails for both.
SolverFactory direct(KinsolOptions options);

/// The same with Iteration::automatic.
SolverFactory direct();

/// The solver of that name: "direct", or kinsol() with the iteration of that name.  Throws Misuse for any
/// other.
SolverFactory named_solver(const std::string& name, KinsolOptions options = {});

}  // namespace diracstep
