#pragma once

#include <diracstep/core/spaces/space.hpp>
#include <diracstep/core/system/first_order_motions.hpp>
#include <diracstep/core/system/saddle_point.hpp>
#include <diracstep/solvers/detail/linear_solver.hpp>
#include <diracstep/validation/references/reference_run.hpp>
#include <memory>
#include <vector>

namespace diracstep {

/// The continuous system with its index reduced to 0, in explicit form: the rows enter only
/// differentiated, so that a numerical solution drifts off them.
///
///   L regular on Δ_Q   y = (q, v),   q̇ = v,   v̇ = a with  [∂²L/∂v² −Aᵀ; A 0] (a, Λ) = …
///   … on a space       y = (q, v),   q̇ = B v,  with the stored numbers q and B = d(q τ(x))/dx at x = 0
///   L linear in v      y = q,        q̇ = v with  (Dθᵀ − Dθ) v = ∂H/∂q
///
/// The accelerations are those of AccelerationProblem, the velocities those of PhaseSpaceVelocityProblem.
class ReducedEquations {
 public:
  /// With `dense` the linear system of a rate is factored as a full matrix.
  ReducedEquations(const Scene& scene, bool dense);

  int size() const { return numbers_ + (acceleration_ ? n_ : 0); }

  /// ẏ at y; false where the linear system is singular.
  bool rate(double t, ConstVectorRef y, VectorRef rate);

  /// The velocity at y, and the forces of the rows.
  bool read(double t, ConstVectorRef y, Vector& v, Vector& forces);

 private:
  bool solve_linear(NonlinearProblem& problem);

  const Space* space_;                                 ///< null in R^n
  int numbers_, n_;                                    ///< of q and v
  std::unique_ptr<AccelerationProblem> acceleration_;  ///< one of the two
  std::unique_ptr<PhaseSpaceVelocityProblem> phase_velocity_;
  std::unique_ptr<detail::LinearSolver> linear_solver_;
  Vector zero_, values_, solution_;
};

/// Who takes the steps of an explicit baseline.
enum class ExplicitCode {
  arkode,  ///< SUNDIALS ARKODE: the Runge–Kutta method of order 8 with an embedded one of order 7 (Fehlberg)
  fehlberg78,      ///< the same method in Boost.odeint
  bulirsch_stoer,  ///< extrapolation of the modified midpoint rule in Boost.odeint
};

/// "ARKODE", "odeint-fehlberg78" or "odeint-bulirsch-stoer".
const char* name(ExplicitCode code);

/// Those that take a scene: ARKODE all of them; Boost.odeint, where the build has it, those that
/// sized_equations() takes.
std::vector<ExplicitCode> explicit_codes(const Scene& scene);

/// What the failure begins with where a scene has no accelerations, so that there is nothing to run.
inline constexpr const char* not_explicit = "not explicit: ";

/// Integrates the equations above from the scene's start to `t_end`: ARKODE those of ReducedEquations,
/// Boost.odeint those of SizedEquations, with the number of unknowns known when it is compiled.  Counts: one
/// residual evaluation is one right-hand side.  Throws Misuse for a bad scene, start, end or option, and for
/// a code that does not take the scene; what a user's function throws passes through.
ReferenceRun integrate_explicitly(const Scene& scene, double t_end, const ReferenceOptions& options,
                                  ExplicitCode code = ExplicitCode::arkode);

}  // namespace diracstep
