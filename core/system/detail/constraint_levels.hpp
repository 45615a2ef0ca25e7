#pragma once

#include <diracstep/core/system/kernel_motions.hpp>
#include <string>
#include <vector>

namespace diracstep {

/// The constraint algorithm (M. J. Gotay, J. M. Nester, G. Hinds, J. Math. Phys. 19, 1978) on the equations
/// K_0(t,z,w) = 0 of a degenerate Lagrangian, z = (q, p_i) and w = (v, Λ),
///
///   ∂L/∂v_i − p_i = 0,   E = 0,   A v + b = 0                                    (kernel_motions.hpp),
///
/// with z' = g(z,w) = (v, (∂L/∂q + f + AᵀΛ)_i).  Where ∂K_l/∂w is singular with constant rank, rows N that
/// span its left kernel give constraints on z alone, N K_l = 0, and N dK_l/dt = N (∂_t + g·∂_z) K_l takes
/// their place in K_{l+1}: until ∂K_l/∂w is regular.  So rows between positions of canonical pairs, whose
/// rates hold momenta, and two-forms dθ that are singular.
///
/// N = (−J_nk J_kk⁻¹, 1) with the rows `kept` and the unknowns `by` that they are solved for; J and the rates
/// are central differences of order 8, good to 1e-13 of their terms for each level.
class LevelledEquations {
 public:
  LevelledEquations(const Scene& scene, const FirstOrderMotions& motions);

  /// K of the last level at (t,z,w), n + m numbers: those that are no rates in front.
  Vector evaluate(double t, ConstVectorRef z, ConstVectorRef w);
  /// K_l of any level.
  Vector at(std::size_t level, double t, ConstVectorRef z, ConstVectorRef w);

  // At the point of the last evaluate():
  const Vector& rate() const { return rate_; }          ///< g
  const Vector& momentum() const { return momentum_; }  ///< ∂L/∂v, n numbers
  double terms() const { return terms_; }               ///< size of what cancels in K_0
  double rate_terms() const;                     ///< of its rates, as far as round-off of differences goes
  double resolved() const { return resolved_; }  ///< shortest time that rates are differenced over

  /// φ, and the left rows of K_l of each level: N K_l at a w that solves K = 0.
  Vector constraints(double t, ConstVectorRef z, ConstVectorRef w);
  /// Their derivative by z along K = 0, by differences good to 1e-7: N ∂K_l/∂z.
  Columns constraint_derivative(double t, ConstVectorRef z, ConstVectorRef w);
  std::string constraint_name(int number) const;

  int unknowns() const { return n_ + m_; }
  int inert() const { return inert_; }
  int constraint_count() const { return holonomic_count_ + hidden_count_; }
  Vector state(ConstVectorRef q, ConstVectorRef p) const;  ///< z, of all of p

 private:
  Vector equations(double t, ConstVectorRef z, ConstVectorRef w);
  Columns by_unknowns(std::size_t level, double t, const Vector& z, const Vector& w);
  Columns left_kernel(std::size_t level, double t, const Vector& z, const Vector& w);

  Scene scene_;
  FirstOrderMotions motions_;
  ConstraintBlocks holonomic_;
  int n_, m_, inert_, holonomic_count_, hidden_count_ = 0;
  KernelPoint point_;
  ConstraintsAtPoint forms_;  ///< of φ
  Vector rate_, momentum_;
  double terms_ = 0.0, resolved_ = 1.0;
};

constexpr int most_with_levels = 40;  ///< coordinates and rows

/// The levels of a scene whose equations of first order leave velocities or forces of rows open; none where
/// ranks change near the start or where two levels do not determine them.
FirstOrderMotions levelled_motions(const Scene& scene);

/// Unknowns (v, Λ) at given t, q, p: the equations of the last level.
class LevelledVelocityProblem final : public MomentumVelocityProblem {
 public:
  LevelledVelocityProblem(const Scene& scene, const FirstOrderMotions& motions);

  void residual(ConstVectorRef x, VectorRef f) override;
  void jacobian(ConstVectorRef x, VectorRef values) override;

 private:
  LevelledEquations equations_;
};

/// w at (t,z) by Newton's method from `w`; NaN where it does not converge.
Vector solved_unknowns(LevelledEquations& equations, double t, const Vector& z, Vector w);

/// The start moved onto the constraints of all levels, as moved_onto_hidden() does for those of one.
Start moved_onto_levels(const Scene& scene, const FirstOrderMotions& motions, Start start,
                        const std::vector<bool>& may_move);

/// Throws InconsistentStart where a start violates a constraint of a level by more than 1e-9 of its terms.
void require_on_levels(const Scene& scene, const FirstOrderMotions& motions);

}  // namespace diracstep
