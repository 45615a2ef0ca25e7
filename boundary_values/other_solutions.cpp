#include <algorithm>
#include <diracstep/boundary_values/guesses.hpp>
#include <diracstep/boundary_values/other_solutions.hpp>
#include <diracstep/core/numerics/errors.hpp>

namespace diracstep {

namespace {

/// The largest difference of two motions in a coordinate at the times of the first.
double apart(const BoundaryReport& one, const BoundaryReport& other) {
  const Eigen::Index stride = (other.times.size() - 1) / (one.times.size() - 1);
  double off = 0.0;
  for (Eigen::Index k = 0; k < one.times.size(); ++k)
    off = std::max(off, (one.q.col(k) - other.q.col(k * stride)).lpNorm<Eigen::Infinity>());
  return off;
}

}  // namespace

std::string doubt_of_steps(BoundaryProblem problem, const BoundaryReport& found) {
  constexpr double far = 0.02;  // of the largest coordinate
  problem.steps *= 2;
  problem.options.step *= 0.5;
  problem.guess = through_points(found.times, found.q, found.v.array().isFinite().select(found.v, 0.0));
  const BoundaryReport finer = solve_boundary_values(problem);
  if (finer.interrupted) return "interrupted before it was compared with that of steps of half the size";
  if (!finer.converged)
    return "with steps of half the size no motion is found near it: it is that of the steps";
  const double off = apart(found, finer);
  if (off <= far * found.q.lpNorm<Eigen::Infinity>()) return "";
  return "with steps of half the size the motion is another, up to " + to_text(off, 2) +
         " off: steps are too large";
}

std::string other_motion(BoundaryProblem problem, const BoundaryReport& found) {
  constexpr double same = 1e-6;
  if (!problem.conditions.start_held || !problem.conditions.end_held) return "";
  try {
    problem.guess =
        motion_from_start(problem.scene, problem.registry, problem.solvers, problem.options, problem.steps);
  } catch (const Error&) {
    return "";
  }
  const BoundaryReport other = solve_boundary_values(problem);
  if (!other.converged || apart(found, other) <= same * found.q.lpNorm<Eigen::Infinity>()) return "";
  return "another motion fulfils the conditions" +
         (other.action ? ", of the action " + to_text(other.action->value) : "") +
         ": the guess chooses; another one leads to others";
}

}  // namespace diracstep
