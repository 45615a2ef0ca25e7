#pragma once

#include <diracstep/core/dirac/discrete_constraint.hpp>
#include <diracstep/core/dirac/generating_function.hpp>
#include <diracstep/core/system/constraint_distribution.hpp>

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
/// γ_Q = Ω♭∘κ_Q⁻¹ : T*(TQ) → T*(T*Q),  (q,v; ξ,η) ↦ (q,η; −ξ,v)            (3.16)
Covector gamma(const Covector& on_tangent_bundle);

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

/// How far ((z0,z1),α) is from a discrete Dirac structure.  There are two readings of (4.24): its base points
/// must agree, so that p1 = D2L_d in a (+) step; or, with the annihilator as (4.22) writes it, they agree as
/// momentum classes, so that p1 − D2L_d ∈ Δ°_Q(q1) as in (4.28) and (8.3).  The library's steps are members
/// in the first sense, which implies the second.
struct Membership {
  double constraint;  ///< maximum norm of c(q0,q1): (q0,q1) ∈ Δ^d_Q
  double
      annihilator;  ///< maximum norm of what α − Ω♭(z0,z1) has outside the annihilator, base point included
  double annihilator_of_class;  ///< the same where momenta of the base point count as classes
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

  /// Maximum norm of the part of a covector at q that lies outside Δ°_Q(q).
  double outside_annihilator(double t, const Vector& q, const Vector& covector);

 private:
  double constraint_norm(Interval step, const Vector& q0, const Vector& q1);

  ConstraintsAtPoint rows_;
  DiscreteConstraint discrete_constraint_;
};

}  // namespace diracstep
