#pragma once

#include <diracstep/core/dirac/discrete_constraint.hpp>
#include <diracstep/core/dirac/generating_function.hpp>
#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <diracstep/core/steps/state.hpp>
#include <diracstep/core/system/scene.hpp>
#include <memory>
#include <string>
#include <vector>

namespace diracstep {

/// Unknowns of the same kind at the stages of a step, s columns of `rows` numbers, and the polynomial through
/// them taken into the next step: stage i there is Σ_k weights(k, i) x_k.
struct StageBlock {
  int rows;
  Columns weights;  ///< s×s
};

/// What does not change from step to step.
struct StepTraits {
  std::string unknowns;                 ///< for plans: "q1 (3), λ (1)"
  int leading_unknowns;                 ///< how many come before the multipliers, whose guess hardly matters
  int scales = 0, multipliers = 0;      ///< how many of each a StepMemory of the step holds
  std::vector<StageBlock> stages = {};  ///< all unknowns in their order; empty for steps without stages
  /// It damps what is too fast for it, so that its mean velocity need not come near that of the start as it
  /// is halved: solutions far from their guess are no sign of another branch.
  bool damped = false;
};

/// One discrete Dirac step as a nonlinear problem: the only thing a solver sees.
///
/// A step is  begin → guess → solve for the unknowns x → finish.  Which step is taken depends on the
/// arguments of begin alone, not on those before it: what a step leaves to the next is a value, in StepEnd.
/// The step alone moves configurations along tangent vectors; whoever sees only its ends compares their
/// velocities. The size of a step may be zero: then there is nothing to solve, and finish does all.
class StepProblem : public NonlinearProblem {
 public:
  /// Freezes the data of the step.
  virtual void begin(Interval step, const State& start, const StepMemory& memory) = 0;

  /// A guess for the unknowns from a velocity at the start.
  virtual void guess(ConstVectorRef v0, VectorRef x) = 0;

  /// Once x solves the problem: its end.
  virtual void finish(ConstVectorRef x, StepEnd& end) = 0;

  virtual StepTraits traits() const = 0;

  /// Empty, or why steps from the start last given to begin() have no residual where a solver asked for one.
  virtual std::string failure() const { return {}; }

  /// From now on, sums over the stages in extended precision with coefficients to match, and q1, p1 with what
  /// rounding drops from them carried into the step that starts there (compensated addition).  Plain sums
  /// with rounded coefficients are a step that is not quite self-adjoint, whose energy drifts linearly by
  /// round-off (Hairer, McLachlan, Razakarivony, BIT 48, 2008).  False where the step has no such form.
  virtual bool compensate() { return false; }
};

/// The discrete Dirac step of a generating function S (Leok and Ohsawa (4.28), (4.35), (4.45), (4.52)):
///
///   p̂0 = p0 + A(q0)ᵀλ + F⁻,   ((q0,p̂0),(q1,p1 − F⁺)) ∈ graph of S,   c(q0,q1) = 0
///
/// where F⁻ and F⁺ are the impulses of a force, absent where the scene has none (discrete_force.hpp).
///
///   type   unknowns     residual
///   one    q1,   hλ     h (p̂0 + D1S(q0,q1)),     c(q0, q1)
///   two    h p1, hλ     h (p̂0 − D1S(q0,p1)),     c(q0, D2S)
///   three  q1,   hλ     q0 + D1S(p̂0,q1),         c(q0, q1)
///   four   h p1, hλ     q0 − D1S(p̂0,p1),         c(q0, −D2S)
///
/// followed by the inner columns of S with their rows ∂S/∂(inner) = 0.  The factors h make rows and unknowns
/// comparable to positions, so that the Jacobian stays of order 1 as h → 0.  Without rows of the constraint
/// there is no λ.  Where S solves its graph for the end, the unknowns are hλ alone with c(q0, q1(p̂0)) = 0, or
/// none. With `dense` the Jacobian is a full matrix.  Throws Misuse for a force with type four, whose end
/// point is not known before its momentum.
std::unique_ptr<StepProblem> dirac_step(std::unique_ptr<GeneratingFunction> generating_function,
                                        const Scene& scene, const ConstraintRule& rule, bool dense);

}  // namespace diracstep
