#pragma once

#include <diracstep/core/system/constraint_distribution.hpp>
#include <diracstep/core/system/lagrangian_derivatives.hpp>
#include <diracstep/core/system/scene.hpp>
#include <vector>

namespace diracstep {

/// The equations of a Lagrangian with rows and a force, and their time derivatives up to an order K: the
/// derivative array (S. L. Campbell, SIAM J. Sci. Stat. Comput. 6, 1985).  At a state z = (q, p_i) of
/// positions and the momenta of the coordinates `inert`, unknowns are the coefficients of
///
///   v(τ) = Σ_j v_j s^j, j ≤ K + 1,   Λ(τ) = Σ_j Λ_j s^j, j ≤ K,   s = τ/σ,   q(τ) = q + ∫v,
///
/// in the order v_0, Λ_0, v_1, Λ_1, …, v_{K+1}, and equations are the coefficients of order k = 0 … K of
///
///   S = A v + b,   ρ = σ (d/dt ∂L/∂v − ∂L/∂q − f − AᵀΛ)
///
/// along this motion, behind ∂L/∂v_i − p_i at τ = 0.  ρ and dS/dt are taken with the exact second derivatives
/// of L at 2r + 1 points within the `reach` σ, r = K + 5; coefficients are combinations of them, exact to the
/// degree 2r. So are the derivatives by unknowns and state, which hold none of L but second ones either.
class EquationArray {
 public:
  EquationArray(const Scene& scene, std::vector<int> inert, int orders);

  int states() const { return n_ + inert_count(); }
  int rows() const { return inert_count() + (n_ + m_) * (orders_ + 1); }
  int unknowns() const { return (n_ + m_) * (orders_ + 1) + n_; }
  int orders() const { return orders_; }
  int inert_count() const { return static_cast<int>(inert_.size()); }
  /// Places of S_k and ρ_k.
  int place_of_row(int k) const { return inert_count() + (n_ + m_) * k; }
  int place_of_motion(int k) const { return place_of_row(k) + m_; }

  double reach() const { return reach_; }
  /// The longest reach, a power of two of parts of the time in which q moves by its size, over which the
  /// equations along the motion of these unknowns are polynomials to round-off; `w` is taken to its units.
  void choose_reach(double t, ConstVectorRef z, Vector& w);
  /// Another reach, with unknowns taken to its units.
  void take_reach(double reach, Vector& w);
  /// Whether the reach was short enough at the last evaluate().
  bool smooth() const;

  void evaluate(double t, ConstVectorRef z, ConstVectorRef w, bool derivatives);

  // At the last evaluate(); derivatives at the last one that was asked for them.
  const Vector& values() const { return values_; }
  const Columns& by_unknowns() const { return by_unknowns_; }
  const Columns& by_state() const { return by_state_; }
  const Vector& momentum() const { return momentum_; }  ///< ∂L/∂v at τ = 0
  Vector rate() const;                                  ///< z' = (v, (∂L/∂q + f + AᵀΛ)_i) at τ = 0
  Columns rate_by_state() const;                        ///< with the unknowns held
  Columns rate_by_leading() const;                      ///< by v_0 and Λ_0
  double terms() const { return terms_; }               ///< size of what cancels in ρ and ∂L/∂v − p
  double row_terms() const { return row_terms_; }       ///< and in S
  /// How fast q would be, at the last derivatives, were its part in the equations of order 0 not in balance,
  /// by their part in v; 0 where one of them is missing.  Velocities below `part_of_rest_speed` of it are
  /// round-off of zero, as at rest, and no size of velocities.
  double rest_speed(ConstVectorRef z) const;
  static constexpr double part_of_rest_speed = 1e-10;
  /// Sizes of round-off in the rows, in units of ε.
  Vector round_off() const;

 private:
  struct Samples {
    Columns vv, qv, qq, fq, fv, a, rq;
    std::vector<Columns> curvature;
  };

  void take(int point, double s, double t, ConstVectorRef z, ConstVectorRef w, bool derivatives);
  void assemble();
  double roughness() const;

  Scene scene_;
  std::vector<int> inert_;
  int n_, m_, orders_, half_, points_;  ///< r, 2r + 1
  double reach_ = 1.0;
  ConstraintsAtPoint constraints_;
  Columns weights_;  ///< column k: the coefficient of order k from values at the points
  Vector tail_;      ///< that of order 1 less the same from two points fewer
  LagrangianDerivatives l_;
  Columns equations_, row_rates_;  ///< ρ and dS/dt at the points
  Samples samples_;
  struct {
    Vector q, v, a, lambda, rate, force, f, along, row_rate;
  } at_;  ///< at a point
  bool constant_hessian_known_ = false;
  Vector values_, momentum_, force_, velocity_, row_values_;
  Columns by_unknowns_, by_state_, force_by_q_, force_by_v_, rows_;
  double terms_ = 0.0, row_terms_ = 0.0;
};

}  // namespace diracstep
