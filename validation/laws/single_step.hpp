#pragma once

#include <array>
#include <cmath>
#include <diracstep/core/methods/method.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <memory>
#include <utility>

/// One step of a method alone, and the laws that are told from one step.
namespace diracstep::laws {

/// A step of a method from any (q0,p0), with its impulse and unknowns; NaN where it fails.
class SingleStep {
 public:
  explicit SingleStep(std::unique_ptr<StepProblem> problem) : problem_(std::move(problem)) {
    if (problem_->size() > 0) solver_ = kinsol()(*problem_);
  }
  SingleStep(const Method& method, const Scene& scene)
      : SingleStep(method.make_step(scene, {.dense = true})) {}

  struct Result {
    Vector q1, p1, impulse;
    Vector unknowns;
  };

  Result operator()(Interval step, const Vector& q0, const Vector& p0, const Vector& v0) {
    Result result{q0, p0, Vector(), Vector(problem_->size())};
    problem_->begin(step, q0, p0);
    problem_->guess(v0, result.unknowns);
    if (solver_ && !solver_->solve(result.unknowns).ok()) {
      result.q1.setConstant(std::nan(""));
      result.p1.setConstant(std::nan(""));
      return result;
    }
    problem_->finish(result.unknowns, result.q1, result.p1, result.impulse);
    return result;
  }

 private:
  std::unique_ptr<StepProblem> problem_;
  std::unique_ptr<NonlinearSolver> solver_;
};

inline Vector join(const Vector& a, const Vector& b) {
  Vector c(a.size() + b.size());
  c << a, b;
  return c;
}

/// ∂L/∂v at the start.
inline Vector start_momentum(const Scene& scene) {
  Vector lq(scene.dimension()), p(scene.dimension());
  scene.lagrangian->gradient(scene.start.time, scene.start.q, scene.start.v, lq, p);
  return p;
}

/// Largest entry of MᵀΩM − Ω for the Jacobian M of a step of size h from the start of a scene without rows,
/// by central differences of sixth order: about 1e-11 for a symplectic step.
inline double symplecticity_defect(const Method& method, const Scene& scene, double h) {
  const int n = scene.dimension();
  SingleStep step(method, scene);
  const auto map = [&](const Vector& z) {
    const auto end = step({scene.start.time, h}, z.head(n), z.tail(n), scene.start.v);
    return join(end.q1, end.p1);
  };
  const Vector z = join(scene.start.q, start_momentum(scene));
  constexpr double delta = 1e-2;
  constexpr std::array<double, 3> weights{45.0 / 60.0, -9.0 / 60.0, 1.0 / 60.0};
  Columns m = Columns::Zero(2 * n, 2 * n);
  for (int j = 0; j < 2 * n; ++j)
    for (int k = 1; k <= 3; ++k) {
      const Vector shift = k * delta * Vector::Unit(2 * n, j);
      m.col(j) += weights[static_cast<std::size_t>(k - 1)] * (map(z + shift) - map(z - shift)) / delta;
    }
  Columns omega = Columns::Zero(2 * n, 2 * n);
  omega.topRightCorner(n, n).setIdentity();
  omega.bottomLeftCorner(n, n) = -Columns::Identity(n, n);
  return (m.transpose() * omega * m - omega).cwiseAbs().maxCoeff();
}

/// Whether the generating function of a method alone determines its step on a scene: it has one, and no row
/// and no force acts at nodes inside the step.
inline bool generating_function_determines(const Method& method, const Scene& scene) {
  const bool inside = method.info.rows_inside && (scene.rows() > 0 || scene.force);
  return method.generating_function && !inside;
}

/// How far a step of size h from the start ends from the one that dirac_step() states for the generating
/// function of the method, in q and p: round-off for a method that steps what it states.
inline double stated_step_defect(const Method& method, const Scene& scene, double h) {
  SingleStep taken(method, scene),
      stated(dirac_step(method.generating_function(scene), scene, method.info.constraint_rule, true));
  const Interval step{scene.start.time, h};
  const Vector p0 = start_momentum(scene);
  const auto a = taken(step, scene.start.q, p0, scene.start.v);
  const auto b = stated(step, scene.start.q, p0, scene.start.v);
  return (join(a.q1, a.p1) - join(b.q1, b.p1)).lpNorm<Eigen::Infinity>();
}

}  // namespace diracstep::laws
