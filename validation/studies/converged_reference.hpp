#pragma once

#include <diracstep/core/methods/registry.hpp>
#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <diracstep/validation/studies/study_run.hpp>

namespace diracstep {

/// The end of a motion that has no known solution, by the first two of GL(6), GL(4) and compositions of order
/// 8 of the midpoint and the trapezoidal rule that the scene takes.  Each method halves its step, from the
/// scene's own, until two ends in a row agree as well as round-off lets them, or `seconds` of CPU time are
/// used up; its sums are compensated where it can.  The reference is the end whose last halving changed
/// least; its own error is the largest of the two last changes and of the difference between the methods.
/// A `damped` motion takes steps of Radau IIA with 5 and 4 stages by their local error, eps = 1e-4, 1e-5, ….
/// `missing` says why there is none: fewer than two methods came to an end.
ReferenceEnd converged_reference(const CatalogueScene& scene, const Registry& registry,
                                 const SolverFactory& solvers, double t_end, double seconds,
                                 const Look& look = {}, bool damped = false);

}  // namespace diracstep
