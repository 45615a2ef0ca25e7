#include <algorithm>
#include <diracstep/boundary_values/guesses.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/run.hpp>
#include <utility>

namespace diracstep {

namespace {

/// What both kinds of problem say of their ends.
struct GuessedProblem {
  std::shared_ptr<const Scene> scene;
  const Registry& registry;
  const SolverFactory& solvers;
  const IntegratorOptions& options;
  long steps;
  const BoundaryConditions& conditions;
};

GuessedMotion guess_of(const GuessedProblem& of) {
  if (!of.conditions.start_held || !of.conditions.end_held)
    return motion_from_start(of.scene, of.registry, of.solvers, of.options, of.steps);
  const int n = of.scene->dimension();
  const double t0 = of.scene->start.time;
  return straight_line(t0, of.conditions.value.head(n), t0 + static_cast<double>(of.steps) * of.options.step,
                       of.conditions.value.tail(n));
}

}  // namespace

GuessedMotion through_points(Vector times, Columns q, Columns v) {
  if (times.size() == 0) throw Misuse("the guess has no points");
  for (const Columns* columns : {&q, &v}) require_size("the guess: columns", columns->cols(), times.size());
  require_size("the guess: numbers of v", v.rows(), q.rows());
  if (!times.allFinite() || !q.allFinite() || !v.allFinite())
    throw Misuse("the guess: a number is not finite");
  for (Eigen::Index k = 1; k < times.size(); ++k)
    if (!((times[k] - times[k - 1]) * (times[times.size() - 1] - times[0]) > 0.0))
      throw Misuse("the guess: t = " + to_text(times[k]) + " does not follow " + to_text(times[k - 1]));
  return [times = std::move(times), q = std::move(q), v = std::move(v)](double t) {
    const Eigen::Index last = times.size() - 1;
    if (last == 0) return GuessedPoint{q.col(0), v.col(0)};
    const double sign = times[last] > times[0] ? 1.0 : -1.0;
    const auto next = std::partition_point(times.begin() + 1, times.begin() + last,
                                           [&](double time) { return sign * (time - t) < 0.0; });
    const Eigen::Index k = next - times.begin() - 1;
    const double part = std::clamp((t - times[k]) / (times[k + 1] - times[k]), 0.0, 1.0);
    return GuessedPoint{q.col(k) + part * (q.col(k + 1) - q.col(k)),
                        v.col(k) + part * (v.col(k + 1) - v.col(k))};
  };
}

GuessedMotion motion_from_start(const std::shared_ptr<const Scene>& scene, const Registry& registry,
                                const SolverFactory& solvers, const IntegratorOptions& options, long steps) {
  Integrator integrator(scene, registry, solvers, options);
  const int n = scene->dimension();
  Vector times(steps + 1);
  Columns q(n, steps + 1), v(n, steps + 1);
  Eigen::Index k = 0;
  const RunReport run = run_steps(integrator, steps, Momentum::projected, 1, [&](const Sample& sample) {
    times[k] = sample.time;
    q.col(k) = sample.q;
    v.col(k) = sample.v.size() > 0 ? sample.v : Vector::Zero(n);
    return ++k <= steps;
  });
  if (k <= steps)
    throw Error("the motion from the start, which is the guess, fails: " + run.last.failure +
                "; another guess is needed");
  return through_points(std::move(times), std::move(q), std::move(v));
}

GuessedMotion usual_guess(const BoundaryProblem& problem) {
  require_steps(problem.steps, most_boundary_steps);
  return guess_of(
      {problem.scene, problem.registry, problem.solvers, problem.options, problem.steps, problem.conditions});
}

GuessedMotion usual_guess(const ControlProblem& problem) {
  require_steps(problem.steps, most_control_steps);
  return guess_of({problem.controlled.scene, problem.registry, problem.solvers, problem.options,
                   problem.steps, problem.conditions});
}

}  // namespace diracstep
