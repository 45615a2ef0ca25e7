#pragma once

#include <diracstep/core/dirac/discrete_constraint.hpp>
#include <diracstep/core/dirac/flow_effort_space.hpp>
#include <diracstep/core/dirac/generating_function.hpp>
#include <diracstep/core/system/constraint_distribution.hpp>
#include <diracstep/core/system/phase_function.hpp>

namespace diracstep {

/// A point of T*Q.
struct PhasePoint {
  Vector q, p;
};

/// A covector on a product of two spaces: base point (x, y), components (ξ, η).
struct Covector {
  Vector x, y, xi, eta;
};

/// A tangent vector of T*Q at (q,p).
struct PhaseVelocity {
  Vector q, p, q_rate, p_rate;
};

// --- Continuous limits

/// Ω♭ : T(T*Q) → T*(T*Q),  (q,p,q̇,ṗ) ↦ (q,p; −ṗ,q̇)                      Leok and Ohsawa (3.5)
Covector omega_flat(const PhaseVelocity& z);
/// κ_Q : T(T*Q) → T*(TQ),  (q,p,q̇,ṗ) ↦ (q,q̇; ṗ,p)                        (3.15)
Covector kappa(const PhaseVelocity& z);
/// γ_Q = Ω♭∘κ_Q⁻¹ : T*(TQ) → T*(T*Q),  (q,v; ξ,η) ↦ (q,η; −ξ,v)            (4.1)
Covector gamma(const Covector& on_tangent_bundle);
/// 𝔇L = γ_Q∘dL : TQ → T*(T*Q),  (q,v) ↦ (q,∂L/∂v; −∂L/∂q,v)                (4.6)
Covector dirac_differential(const Lagrangian& lagrangian, double t, const Vector& q, const Vector& v);
/// dH : T*Q → T*(T*Q),  (q,p) ↦ (q,p; ∂H/∂q,∂H/∂p)                         (4.10)
Covector differential(const Hamiltonian& hamiltonian, double t, const Vector& q, const Vector& p);

// --- Discrete maps

/// κ^d_Q : T*Q×T*Q → T*(Q×Q),  ((q0,p0),(q1,p1)) ↦ (q0,q1; −p0,p1)          (2.13)
Covector discrete_kappa(const PhasePoint& z0, const PhasePoint& z1);
/// Ω♭_{d+} : T*Q×T*Q → T*(Q×Q*),  ↦ (q0,p1; p0,q1)                           (2.20)
Covector omega_flat_plus(const PhasePoint& z0, const PhasePoint& z1);
/// Ω♭_{d−} : T*Q×T*Q → T*(Q*×Q),  ↦ (p0,q1; −q0,−p1)                         (2.27)
Covector omega_flat_minus(const PhasePoint& z0, const PhasePoint& z1);
/// γ^{d+}_Q = Ω♭_{d+}∘(κ^d_Q)⁻¹,  (q0,q1; ξ,η) ↦ (q0,η; −ξ,q1)               (4.25)
Covector gamma_plus(const Covector& on_pairs);
/// γ^{d−}_Q = Ω♭_{d−}∘(κ^d_Q)⁻¹,  (q0,q1; ξ,η) ↦ (−ξ,q1; −q0,−η)             (4.42)
Covector gamma_minus(const Covector& on_pairs);

// --- One-forms on T*Q×T*Q

/// A one-form on T*Q×T*Q at a point ((q0,p0),(q1,p1)).
struct PairForm {
  Vector dq0, dp0, dq1, dp1;

  /// Its value on the tangent vector (w0,w1).
  double on(const PhasePoint& w0, const PhasePoint& w1) const;
};

/// λ_{d±} = (κ^d_Q)*Θ = −p0 dq0 + p1 dq1                                   (4.15), (4.39)
PairForm lambda_d(const PhasePoint& z0, const PhasePoint& z1);
/// χ_{d+} = (Ω♭_{d+})*Θ = p0 dq0 + q1 dp1                                    (4.14)
PairForm chi_plus(const PhasePoint& z0, const PhasePoint& z1);
/// χ_{d−} = (Ω♭_{d−})*Θ = −q0 dp0 − p1 dq1                                   (4.38)
PairForm chi_minus(const PhasePoint& z0, const PhasePoint& z1);
/// Ω_{T*Q×T*Q}((w0,w1),(u0,u1)), Ω = dq1∧dp1 − dq0∧dp0 = −dλ_{d±} = dχ_{d±}  (2.2), (4.16), (4.40)
double symplectic_form(const PhasePoint& w0, const PhasePoint& w1, const PhasePoint& u0,
                       const PhasePoint& u1);

// --- Discrete Legendre transforms and energies of L_d at (q0,q1)

/// First derivatives of L_d at a pair of points, and its value.
struct DiscreteLagrangianAt {
  Vector q0, q1;
  double value;
  Vector d1, d2;
};
/// Throws Misuse unless `lagrangian` is of type 1.  With inner columns they must be given at stationarity.
DiscreteLagrangianAt evaluate(GeneratingFunction& lagrangian, Interval step, const Columns& y);

/// FL_d⁺(q0,q1) = (q1, D2L_d)                                               (9.3)
PhasePoint legendre_plus(const DiscreteLagrangianAt& l);
/// FL_d⁻(q0,q1) = (q0, −D1L_d)                                              (9.4)
PhasePoint legendre_minus(const DiscreteLagrangianAt& l);
/// G_{d+} = p1·q1, on T*Q×T*Q                                                (6.9)
double momentum_function_plus(const PhasePoint& z0, const PhasePoint& z1);
/// G_{d−} = −p0·q0                                                           (6.10)
double momentum_function_minus(const PhasePoint& z0, const PhasePoint& z1);
/// E_{d+} = p1·q1 − L_d                                                      (6.13)
double generalised_energy_plus(const DiscreteLagrangianAt& l, const Vector& p1);
/// E_{d−} = −p0·q0 − L_d                                                     (6.14)
double generalised_energy_minus(const DiscreteLagrangianAt& l, const Vector& p0);
/// H_{d+} = E_{d+} where it is stationary, p1 = D2L_d                        (9.6), (9.8)
double discrete_hamiltonian_plus(const DiscreteLagrangianAt& l);
/// H_{d−} = E_{d−} where it is stationary, p0 = −D1L_d                       (9.7), (9.9)
double discrete_hamiltonian_minus(const DiscreteLagrangianAt& l);
/// D⁺L_d = γ^{d+}_Q(dL_d)                                                    (4.26)
Covector differential_plus(const DiscreteLagrangianAt& l);
/// D⁻L_d = γ^{d−}_Q(dL_d)                                                    (4.43)
Covector differential_minus(const DiscreteLagrangianAt& l);

// --- Membership

/// A flow and an effort in T_zT*Q × T*_zT*Q, 2n numbers each: those of q in front of those of p.
struct FlowAndEffort {
  Vector flow, effort;
};
/// Of (X, α) at a point of T*Q: flow (q̇,ṗ), effort (ξ,η).
FlowAndEffort flow_and_effort(const PhaseVelocity& x, const Covector& alpha);
/// Of ((z0,z1),α) with α over (q0,p1): flow z1 − z0, effort α − d(p1·q0) = (ξ − p1, η − q0).  The identity
/// map has S2 = p1·q0, so both vanish for a step that goes nowhere, and are h times those of the motion as h
/// → 0.
FlowAndEffort flow_and_effort_plus(const PhasePoint& z0, const PhasePoint& z1, const Covector& alpha);
/// Of ((z0,z1),α) with α over (p0,q1): flow z1 − z0, effort α + d(p0·q1) = (η + p0, ξ + q1).
FlowAndEffort flow_and_effort_minus(const PhasePoint& z0, const PhasePoint& z1, const Covector& alpha);

/// How far (X, α) is from a Dirac structure, or ((z0,z1),α) from a discrete one.  There are two readings of
/// (4.24): its base points must agree, so that p1 = D2L_d in a (+) step; or, with the annihilator as (4.22)
/// writes it, they agree as momentum classes, so that p1 − D2L_d ∈ Δ°_Q(q1) as in (4.28) and (8.3).  The
/// library's steps are members in the first sense, which implies the second.
struct Membership {
  double constraint;  ///< maximum norm of c(q0,q1): (q0,q1) ∈ Δ^d_Q; of A q̇ + b in the continuous case
  double
      annihilator;  ///< maximum norm of what α − Ω♭(z0,z1) has outside the annihilator, base point included
  double annihilator_of_class;  ///< the same where momenta of the base point count as classes
};

/// The Dirac structure D_{Δ_Q} on T*Q of a distribution Δ_Q = ker A:
///
///   D_{Δ_Q}(z) = {(X,α) : A q̇ = 0,  α − Ω♭(X) ∈ Δ°_Q × {0}}                  (4.4), (4.5); (4.8) without
///   rows
///
/// Rows may be affine, A v + b = 0: D_{Δ_Q} is that of A then, and membership() takes b with it.
class DiracStructure {
 public:
  DiracStructure(const ConstraintBlocks& constraints, int dimension);

  /// D_{Δ_Q} at a point of T*Q over q: A f_q = 0,  e_q + f_p ∈ Δ°_Q(q),  e_p = f_q.  Dimension 2n, equal to
  /// its orthogonal to round-off.
  FlowEffortSpace at(double t, const Vector& q);

  /// The same with ports behind, at which efforts act along the columns of C (n×c):
  ///
  ///   A f_q = 0,  e_q + f_p − C e_c ∈ Δ°_Q(q),  e_p = f_q,  f_c = −Cᵀ f_q
  ///
  /// The power e_c·f_c at the ports is what the rest takes, so this is a Dirac structure of 2n + c flows.
  /// Two of these and the distribution_structure() of rows B between their ports compose to that of the
  /// interconnected scene, whose rows are A and B Cᵀ.
  FlowEffortSpace with_ports(double t, const Vector& q, const Columns& ports);

  /// (X,α) ∈ D_{Δ_Q}: A q̇ + b = 0, ξ + ṗ ∈ Δ°_Q(q), η = q̇, and α over the base point of X, its p as a
  /// momentum or as its class.  With 𝔇L this is (4.7), with dH (4.11).
  Membership membership(double t, const PhaseVelocity& x, const Covector& alpha);

 private:
  ConstraintsAtPoint rows_;
};

/// The discrete Dirac structures D_{d+} (4.24) and D_{d−} (4.41) of a discrete constraint.
class DiscreteDiracStructure {
 public:
  DiscreteDiracStructure(const ConstraintBlocks& constraints, int dimension, const ConstraintRule& rule);

  /// ((z0,z1),α) ∈ D_{d+}: (q0,q1) ∈ Δ^d_Q and α − Ω♭_{d+}(z0,z1) ∈ Δ°_Q(q0) × {0}, at the same (q0,p1), or
  /// at one whose p1 differs by Δ°_Q(q1).
  Membership plus(Interval step, const PhasePoint& z0, const PhasePoint& z1, const Covector& alpha);
  /// ((z0,z1),α) ∈ D_{d−}: (q0,q1) ∈ Δ^d_Q and α − Ω♭_{d−}(z0,z1) ∈ {0} × Δ°_Q(q1), at the same (p0,q1), or
  /// at one whose p0 differs by Δ°_Q(q0).
  Membership minus(Interval step, const PhasePoint& z0, const PhasePoint& z1, const Covector& alpha);

  /// The tangent space of D_{d+}(z0) over (q0,q1), in flows and efforts as flow_and_effort_plus() has them:
  ///
  ///   ∂c/∂q1 f_q = 0,   e_q + f_p ∈ Δ°_Q(q0),   e_p = f_q
  ///
  /// Dimension 2n.  It is a Dirac structure where ∂c/∂q1 spans Δ°_Q(q0): on the diagonal, where it is
  /// D_{Δ_Q}(z0), and everywhere for linear nonholonomic rows by the left rule, so that D_{d+}(z0) itself is
  /// D_{Δ_Q}(z0), moved.  Elsewhere both defects are of the order of the step.
  FlowEffortSpace plus_at(Interval step, const Vector& q0, const Vector& q1);
  /// The tangent space of the elements of D_{d−} that end at z1, by z0, on which a (−) discrete vector field
  /// is a section; flows and efforts as flow_and_effort_minus() has them:
  ///
  ///   ∂c/∂q0 f_q = 0,   e_q + f_p ∈ Δ°_Q(q1),   e_p = f_q
  ///
  /// A Dirac structure on the diagonal and for the right rule.  Holonomic rows are φ(t0,q0) here.
  FlowEffortSpace minus_at(Interval step, const Vector& q0, const Vector& q1);

  int rows() const { return rows_.rows(); }
  /// A(t,q), m×n: its rows span Δ°_Q(q).
  Columns one_forms(double t, const Vector& q);
  /// c(q0,q1) with the holonomic rows taken at `holonomic_at_start` ? q0 : q1.
  Vector discrete_constraint(Interval step, const Vector& q0, const Vector& q1, bool holonomic_at_start);

  /// Maximum norm of the part of a covector at q that lies outside Δ°_Q(q).
  double outside_annihilator(double t, const Vector& q, const Vector& covector);

 private:
  Columns start_derivative(Interval step, const Vector& q0, const Vector& q1);

  ConstraintsAtPoint rows_;
  DiscreteConstraint discrete_constraint_;
  DiscreteConstraint reversed_constraint_;  ///< by the mirrored rule, of use where no rows are one's own
  bool own_rows_;
};

}  // namespace diracstep
