#pragma once

#include <diracstep/boundary_values/optimal_control.hpp>

namespace diracstep {

/// Through points of a motion, straight between them: a column of q and of v for each time.  Throws Misuse
/// for sizes that disagree, numbers that are not finite, and times that do not all rise or all fall.
GuessedMotion through_points(Vector times, Columns q, Columns v);

/// The motion from the start of the scene, by so many steps.  Throws Error where it fails.
GuessedMotion motion_from_start(const std::shared_ptr<const Scene>& scene, const Registry& registry,
                                const SolverFactory& solvers, const IntegratorOptions& options, long steps);

/// A straight line where both places are held, else motion_from_start().
GuessedMotion usual_guess(const BoundaryProblem& problem);
GuessedMotion usual_guess(const ControlProblem& problem);

}  // namespace diracstep
