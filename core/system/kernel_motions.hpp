#pragma once

#include <array>
#include <diracstep/core/system/first_order_motions.hpp>
#include <memory>
#include <string>
#include <vector>

namespace diracstep {

/// A Lagrangian whose ∂²L/∂v² has a kernel of constant rank k that may move, and equations along it that need
/// not hold the velocities along it.
///
/// Columns of W(t,q,v) span the kernel, scaled to W = 1 at the coordinates `along`, so that with M = ∂²L/∂v²
/// W = −M_ii⁻¹ M_ia at the others, i (`inert`). Momenta p_i are a state beside q; all of p is a function of
/// both. Velocities u along W and forces Λ of the rows are to be determined by
///
///   E = Wᵀ[(∂²L/∂v∂q) v + ∂²L/∂v∂t − ∂L/∂q − f − AᵀΛ] = 0,   r = A v + b = 0.
///
/// `hidden` tells for each of these k + m equations whether it is free of u and Λ: then it is a constraint
/// on (q, p_i), Dirac's secondary constraint, and its time derivative takes its place.  So it is with
/// ½(1 + s²)v_x² − V(x,s), where E = V_s − s v_x² determines s, and with ½(v_0 + q_1 v_2)² + ½ v_1² − V,
/// where the primary constraint p_2 = q_1 p_0 moves.  In Hessenberg form of index 2 in (q, p_i).
///
/// Returns motions with `hidden` filled where the kernel moves, where a hidden equation holds velocities, or
/// where the equations of motions of first order hide some; else none: first_order_motions() and
/// hidden_rows() deal with those, and with ranks that change nothing does.  At most 200 coordinates and rows.
FirstOrderMotions kernel_motions(const Scene& scene, bool first_order);

/// `along` and `inert` by the pivots of ∂²L/∂v²; both empty where that is regular.
void divide_coordinates(const Columns& mass, FirstOrderMotions& motions);

/// E and r at a point, and their derivatives.
class KernelPoint {
 public:
  KernelPoint(const Scene& scene, const FirstOrderMotions& motions)
      : motions_(motions), point_(scene, motions), beside_(scene, motions) {}

  void evaluate(double t, ConstVectorRef q, ConstVectorRef v, ConstVectorRef lambda);
  /// Those below and those of full(), after evaluate() at the same point.  Of E by central differences, good
  /// to 1e-10: they hold third derivatives of L, and only Newton's method takes them.
  void differentiate();
  /// Those of full() alone.
  void take_matrices() { point_.differentiate(); }

  const FirstOrderPoint& full() const { return point_; }
  const FirstOrderMotions& motions() const { return motions_; }
  const Vector& along() const { return along_; }  ///< E
  double terms() const { return terms_; }         ///< size of what cancels in E
  const Columns& kernel() const { return w_; }    ///< W, n×k
  Vector inert(ConstVectorRef x) const;           ///< the components i of a column

  const Columns& along_by_q() const { return by_q_; }
  const Columns& along_by_v() const { return by_v_; }
  Columns along_by_lambda() const { return -w_.transpose() * point_.rows().transpose(); }

  /// d/dt of the hidden equations, in their order, along the motion of given v and Λ:  of rows exact; of E by
  /// central differences of order 8 along it, good to about 1e-13 of E's terms over the time in which q or v
  /// change by their size.  `resolved` is the time that round-off of the differences is measured by.  After
  /// take_matrices().
  Vector hidden_rates(double& resolved);

 private:
  /// E, W and the size of terms at another point.
  Vector along_at(FirstOrderPoint& point, Columns& w, double& terms) const;
  Vector acceleration() const;

  FirstOrderMotions motions_;
  FirstOrderPoint point_, beside_;
  double t_ = 0.0, terms_ = 0.0;
  Vector q_, v_, lambda_, along_;
  Columns w_, by_q_, by_v_;
};

/// Unknowns (v, Λ) at given t, q, p: ∂L/∂v_i = p_i, the equations of KernelPoint that are not hidden, and the
/// time derivatives of those that are.
class KernelVelocityProblem final : public MomentumVelocityProblem {
 public:
  KernelVelocityProblem(const Scene& scene, const FirstOrderMotions& motions);

  void residual(ConstVectorRef x, VectorRef f) override;
  void jacobian(ConstVectorRef x, VectorRef values) override;

 private:
  int inert_;
  KernelPoint point_;
};

/// Unknowns (v, κ) at given t, q, p of motions by_force (first_order_motions.hpp), W with A W = 0: steps
/// leave the class of p, as VelocityProblem takes it, and the forces determine v along W,
///
///   Uᵀ(∂L/∂v − p − μ Aᵀκ) = 0,   Wᵀ(∂L/∂q + f) = 0,   A v + b = 0,
///
/// μ being the largest entry of ∂²L/∂v².
class ByForceVelocityProblem final : public MomentumVelocityProblem {
 public:
  ByForceVelocityProblem(const Scene& scene, const FirstOrderMotions& motions);

  void residual(ConstVectorRef x, VectorRef f) override;
  void jacobian(ConstVectorRef x, VectorRef values) override;

  /// Whether v is the velocity of p itself, to round-off, and meets the equations of forces as the last stage
  /// of a step was solved for.  To solve for v again would then lose digits: where windings are coupled
  /// tightly, currents far smaller than those that magnetise follow from p by differences of large terms.
  bool holds(ConstVectorRef v);
  /// By solve_monotonically(), from a guess far away; empty, or why there is no solution.
  std::string solve_from_afar(Vector& x);
  /// Λ at (t, q) and v, with some acceleration a; what a is along W counts nowhere:
  ///
  ///   Uᵀ[(∂²L/∂v²) a + (∂²L/∂v∂q) v + ∂²L/∂v∂t − ∂L/∂q − f − AᵀΛ] = 0,   Wᵀa = 0,   d/dt (A v + b) = 0
  Vector forces(ConstVectorRef v);

 private:
  double unit() const;
  FirstOrderPoint point_;
  ConstraintsAtPoint rows_;
  std::array<double, 3> first_{};  ///< scales of the blocks at the guess
};

/// Throws InconsistentStart where a start violates a hidden equation by more than 1e-10 of its terms; names
/// it.
void require_on_hidden(const Scene& scene, const FirstOrderMotions& motions);

}  // namespace diracstep
