#pragma once

#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <diracstep/core/system/constraint_distribution.hpp>
#include <diracstep/core/system/lagrangian_derivatives.hpp>
#include <diracstep/core/system/scene.hpp>
#include <memory>
#include <string>
#include <vector>

namespace diracstep {

/// Of the equations of a scene and `count` time derivatives of them, the levels of the constraint algorithm:
/// those that determine unknowns, the unknowns that they are solved for, and those beside them that are
/// constraints.
struct ConstraintLevels {
  int count = 0;
  std::vector<int> kept, by, left = {};

  bool empty() const { return count == 0; }
};

/// The motions of first order of a Lagrangian: the columns of W span the constant kernel of ∂²L/∂v², and
/// their momenta Wᵀ ∂L/∂v depend on positions, so that their equations of motion
///
///   Wᵀ[(∂²L/∂v∂q) v + ∂²L/∂v∂t − ∂L/∂q − f − AᵀΛ] = 0
///
/// hold velocities and no accelerations.  W = 1 for phase-space Lagrangians θ(t,q)·v − H(t,q), where they
/// read (Dθ − Dθᵀ) v = −∇H − ∂θ/∂t + f + AᵀΛ; L = v_x²/2 + z v_y − V has y and z of first and x of second
/// order. The columns of U span what is orthogonal to W: motions with inertia.
///
/// `by_force`: momenta along W, here the part of the kernel with A W = 0, are constant, but a force along W
/// is not linear in v, such as the voltage of a diode in a loop without inductors.  Wᵀ(∂L/∂q + f) = 0 gives
/// velocities by ∂f/∂v, at each instant (ByForceVelocityProblem in kernel_motions.hpp); ordinary steps do so.
///
/// `hidden`: the kernel moves, or equations along it hold no velocity along it and are constraints
/// (kernel_motions.hpp); w is the kernel near the start, and momenta of the coordinates `inert` are the
/// state.
///
/// `levels`: combinations of these equations and of the rows are constraints, or constraints have rates that
/// are constraints again (detail/constraint_levels.hpp); `along` and `inert` as above.  Where no number of
/// levels determines velocities and forces of rows, `open` holds the directions of (v, Λ) that stay open, and
/// where equations contradict each other, `contradiction` names the one that is off most.
struct FirstOrderMotions {
  Columns w, u;
  bool by_force = false;
  std::vector<int> along = {}, inert = {};
  std::vector<bool> hidden = {};
  ConstraintLevels levels = {};
  Columns open = {};
  std::string contradiction = {};

  bool exist() const { return w.cols() > 0; }
  bool hide_equations() const { return !hidden.empty() || !levels.empty(); }
};

/// Whether ∂²L/∂v² at the start is positive definite whatever the units of the coordinates: the cheap test
/// that nearly every scene passes.
bool positive_definite(const Lagrangian& lagrangian, const Start& start);

/// Those of a completed scene; none where all motions have inertia, and where momenta along W are constant,
/// as in circuits, and no force along them is non-linear in v: these hidden_rows.hpp deals with.
FirstOrderMotions first_order_motions(const Scene& scene);

/// Whether these are the motions of a Lagrangian linear in v alone, without rows and force: the two-form then
/// gives the velocity (PhaseSpaceVelocityProblem).
bool by_two_form_alone(const Scene& scene, const FirstOrderMotions& motions);

/// A scene with motions of first order at one point: the derivatives of L, f and the rows there, as full
/// matrices, and the equations that determine velocities and forces of rows,
///
///   Uᵀ(∂L/∂v − p) = 0,   Wᵀ[(∂²L/∂v∂q) v + ∂²L/∂v∂t − ∂L/∂q − f − AᵀΛ] = 0,   A v + b = 0.
class FirstOrderPoint {
 public:
  FirstOrderPoint(const Scene& scene, FirstOrderMotions motions);

  void evaluate(double t, ConstVectorRef q, ConstVectorRef v, ConstVectorRef lambda);
  /// Second derivatives, after evaluate() at the same point.
  void differentiate();

  const Vector& momentum() const { return l_.v; }               ///< ∂L/∂v
  const Vector& force() const { return force_; }                ///< ∂L/∂q + f + AᵀΛ
  const Vector& momentum_rate() const { return rate_; }         ///< (∂²L/∂v∂q) v + ∂²L/∂v∂t
  const Vector& row_residual() const { return row_residual_; }  ///< A v + b
  Columns mass_here() const { return scene_.lagrangian->pattern().full(l_.vv); }  ///< ∂²L/∂v², at once
  const Columns& mass() const { return mass_; }                                   ///< ∂²L/∂v²
  const Columns& momentum_by_q() const { return by_q_; }                          ///< ∂²L/∂v∂q
  const Columns& rate_by_q() const {
    return rate_by_q_;
  }  ///< ∂ momentum_rate()/∂q; by a difference of second
     ///< derivatives along the motion, where L is not quadratic
  const Columns& force_by_q() const { return force_by_q_; }
  const Columns& force_by_v() const { return force_by_v_; }
  const Columns& rows() const { return a_; }             ///< A
  const Columns& row_by_q() const { return row_by_q_; }  ///< ∂(A v + b)/∂q
  const Vector& row_by_t() const { return row_by_t_; }   ///< ∂(A v + b)/∂t
  const FirstOrderMotions& motions() const { return motions_; }

 private:
  const Scene& scene_;
  FirstOrderMotions motions_;
  ConstraintsAtPoint constraints_;
  double t_ = 0.0;
  LagrangianDerivatives l_;
  Vector q_, v_, lambda_, f_, force_, rate_, row_residual_, row_by_t_;
  Columns mass_, by_q_, rate_by_q_, force_by_q_, force_by_v_, a_, row_by_q_;
};

/// Unknowns (v, Λ) at given t, q, p.
class MomentumVelocityProblem : public NonlinearProblem {
 public:
  int size() const final { return n_ + m_; }
  const SparsityPattern& pattern() const final { return pattern_; }
  std::span<const ResidualBlock> blocks() const final { return blocks_; }
  void begin(double t, ConstVectorRef q, ConstVectorRef p);
  /// From now on what is solved within starts from the last solution: quicker along a motion, but bits depend
  /// on where it was asked before.
  virtual void start_from_last() {}

 protected:
  explicit MomentumVelocityProblem(const Scene& scene);

  int n_, m_;
  std::vector<ResidualBlock> blocks_;
  double t_ = 0.0;
  Vector q_, p_;

 private:
  SparsityPattern pattern_;
};

/// By the equations of FirstOrderPoint.
class FirstOrderVelocityProblem final : public MomentumVelocityProblem {
 public:
  FirstOrderVelocityProblem(const Scene& scene, const FirstOrderMotions& motions);

  void residual(ConstVectorRef x, VectorRef f) override;
  void jacobian(ConstVectorRef x, VectorRef values) override;

 private:
  FirstOrderPoint point_;
};

/// The one of the two, here and in kernel_motions.hpp, that motions ask for.
std::unique_ptr<MomentumVelocityProblem> velocity_problem(const Scene& scene,
                                                          const FirstOrderMotions& motions);

constexpr int most_coordinates_of_first_order = 1500;  ///< matrices are full
constexpr double regular_to = 1e-13;

/// Directions of (v, Λ), as columns, that the equations of velocity_problem() leave open at the start.
Columns open_directions(const Scene& scene, const FirstOrderMotions& motions);

/// Throws Misuse where the equations of velocity_problem() do not determine (v, Λ) at the start, with the
/// velocities and the forces of rows that they leave open.
void require_determined(const Scene& scene, const FirstOrderMotions& motions);

}  // namespace diracstep
