#pragma once

#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <diracstep/core/system/scene.hpp>
#include <string>

namespace diracstep {

/// Why a solve of `problem`, a system of this scene, ended at x: tells a singular Jacobian from slow
/// convergence by a factorisation with full pivoting of the Jacobian at x, its rows and columns scaled to the
/// same size. Where it is singular or nearly so (a bifurcation, dependent rows, a degenerate D1D2 L_d on the
/// constraint), names the coordinates and rows whose equations depend on one another; else says that it is
/// regular, and how well conditioned.  Empty for more than 1500 unknowns.
std::string describe_singularity(NonlinearProblem& problem, ConstVectorRef x, const Scene& scene);

}  // namespace diracstep
