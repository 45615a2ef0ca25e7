#pragma once

#include <diracstep/core/dirac/discrete_constraint.hpp>
#include <diracstep/core/dirac/generating_function.hpp>
#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <diracstep/core/system/scene.hpp>
#include <memory>
#include <string>
#include <vector>

namespace diracstep {

/// One discrete Dirac step as a nonlinear problem: the only thing a solver sees.
///
/// A step from (q0,p0) is  begin → solve for the unknowns x → finish.  Its size may be zero: then there is
/// nothing to solve, and finish does all.
class StepProblem : public NonlinearProblem {
 public:
  /// Freezes the data of the step.
  virtual void begin(Interval step, const Vector& q0, const Vector& p0) = 0;

  /// A guess for the unknowns from a velocity at q0.
  virtual void guess(const Vector& v0, VectorRef x) = 0;

  /// Once x solves the problem: the end point, and the impulse λ (momentum over the unit of a row) that
  /// entered at q0 as A(q0)ᵀλ.
  virtual void finish(ConstVectorRef x, Vector& q1, Vector& p1, Vector& impulse) = 0;

  /// For steps with several stages: x from the polynomials through the stages of the last step, taken into
  /// this one; linear in `last`.  False where the step has no such polynomials.
  virtual bool extrapolate_stages(ConstVectorRef /*last*/, VectorRef /*x*/) const { return false; }

  /// How many unknowns come before the multipliers, whose guess hardly matters.
  virtual int leading_unknowns() const { return size(); }

  /// Keeps what the next steps need of the one just finished: the sizes of terms that round-off is judged by.
  /// Until then a step leaves no trace.
  virtual void keep() {}
  /// From now on, sums over the stages in extended precision with coefficients to match, and q1, p1 with what
  /// rounding drops from them carried into the step that starts there (compensated addition).  Plain sums
  /// with rounded coefficients are a step that is not quite self-adjoint, whose energy drifts linearly by
  /// round-off (Hairer, McLachlan, Razakarivony, BIT 48, 2008).  False where the step has no such form.
  virtual bool compensate() { return false; }

  /// Forgets all that earlier steps left behind, so that a run repeats bit by bit.
  virtual void reset() {}

  /// Writes and reads what was kept.
  virtual void save(Snapshot& /*to*/) const {}
  virtual void restore(Snapshot& /*from*/) {}

  /// What the unknowns are, for plans: "q1 (3), λ (1)".
  virtual std::string unknowns() const = 0;
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
