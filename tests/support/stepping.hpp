#pragma once

#include <gtest/gtest.h>

#include <diracstep/core/runs/run.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <string>
#include <vector>

namespace diracstep::testing {

/// Kept points of a run; fails the test where the run fails.
inline std::vector<Sample> samples_of(const std::shared_ptr<const Scene>& scene, IntegratorOptions options,
                                      long steps, Momentum momentum = Momentum::projected,
                                      const Registry& registry = Registry::with_built_ins()) {
  Integrator integrator(scene, registry, kinsol(), std::move(options));
  std::vector<Sample> samples;
  const RunReport report = run(integrator, steps, momentum, 1, [&](const Sample& sample) {
    samples.push_back(sample);
    return true;
  });
  EXPECT_TRUE(report.ok()) << report.last.failure;
  return samples;
}

inline Vector join(const Vector& a, const Vector& b) {
  Vector c(a.size() + b.size());
  c << a, b;
  return c;
}

/// A single step of a method, from any (q0,p0), with the impulse; NaN where it fails.
class SingleStep {
 public:
  SingleStep(const Method& method, const Scene& scene) : problem_(method.step(scene, true)) {
    if (problem_->size() > 0) solver_ = kinsol()(*problem_);
  }

  struct Result {
    Vector q1, p1, impulse;
  };

  Result operator()(Interval step, const Vector& q0, const Vector& p0, const Vector& v0) {
    Result result{q0, p0, Vector()};
    Vector x(problem_->size());
    problem_->begin(step, {q0, p0, v0}, {});
    problem_->guess(v0, x);
    if (solver_ && !solver_->solve(x).ok()) {
      result.q1.setConstant(std::nan(""));
      result.p1.setConstant(std::nan(""));
      return result;
    }
    StepEnd end;
    problem_->finish(x, end);
    return {end.q, end.p, end.impulse};
  }

 private:
  std::unique_ptr<StepProblem> problem_;
  std::unique_ptr<NonlinearSolver> solver_;
};

}  // namespace diracstep::testing
