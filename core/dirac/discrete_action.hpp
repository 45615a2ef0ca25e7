#pragma once

#include <diracstep/core/dirac/dirac_structure.hpp>
#include <diracstep/core/dirac/generating_function.hpp>
#include <vector>

namespace diracstep {

/// A curve on the discrete Pontryagin bundle, N steps: pairs (q⁰_k, q¹_k) for k = 0 … N−1 and momenta p_0 …
/// p_N. For a trajectory q¹_k = q⁰_{k+1} = q_{k+1}.
struct DiscreteCurve {
  double start = 0.0;
  double step = 0.0;
  std::vector<Vector> q0, q1, p;

  std::size_t steps() const { return q0.size(); }
  Interval interval(std::size_t k) const { return {start + static_cast<double>(k) * step, step}; }
};

/// The curve of a trajectory of N+1 configurations and momenta.
DiscreteCurve curve_of(double start, double step, const std::vector<Vector>& q, const std::vector<Vector>& p);

/// The (+) discrete Hamilton–Pontryagin sum  Σ_{k<N} L_d(q⁰_k,q¹_k) − Σ_{k<N−1} p_{k+1}·(q¹_k − q⁰_{k+1})
/// (Leok and Ohsawa (7.1)); with constraints, of the Lagrange–d'Alembert–Pontryagin principle (8.1).  The (−)
/// sum (8.2) counts the same pairings from their other end, so with the ends held fixed its value is the
/// same.
double hamilton_pontryagin_sum(GeneratingFunction& lagrangian, const DiscreteCurve& curve);

/// The phase-space sums, with q_k = q⁰_k and q_{k+1} = q¹_k:
///
///   Σ [p_{k+1}·q_{k+1} − H_{d+}(q_k,p_{k+1})] for H_{d+} of type 2                  (9.10), (10.1)
///   Σ [−p_k·q_k − H_{d−}(p_k,q_{k+1})]        for H_{d−} of type 3                  (9.11), (10.3)
double phase_space_sum(GeneratingFunction& hamiltonian, const DiscreteCurve& curve);

/// The largest violation of the stationarity of the sum of S along the curve under δq ∈ Δ_Q, δp free,
/// together with q¹_k = q⁰_{k+1}: the principles (8.1), (10.1), (10.3), whose equations are (8.3), (9.14),
/// (9.15) up to Δ°_Q.
///
///   type 1   D1L_d + p_k ∈ Δ°_Q(q_k),   D2L_d − p_{k+1} ∈ Δ°_Q(q_{k+1})   momenta of the (+) or (−) system
///   type 2   p_k − D1H_{d+} ∈ Δ°_Q(q_k),   q_{k+1} = D2H_{d+}             momenta of the (+) system
///   type 3   q_k = −D1H_{d−},   p_{k+1} + D2H_{d−} ∈ Δ°_Q(q_{k+1})        momenta of the (−) system
///
/// Membership of the pairs in Δ^d_Q is a matter of its own; see DiscreteDiracStructure.  Throws Misuse for
/// type 4.
double stationarity_residual(GeneratingFunction& s, DiscreteDiracStructure& structure,
                             const DiscreteCurve& curve);

}  // namespace diracstep
