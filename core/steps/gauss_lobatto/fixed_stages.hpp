#pragma once

#include <diracstep/core/numerics/contraction.hpp>
#include <diracstep/core/numerics/types.hpp>
#include <diracstep/core/steps/gauss_lobatto/points.hpp>
#include <diracstep/core/system/constraint_rows.hpp>
#include <diracstep/core/system/phase_function.hpp>
#include <functional>
#include <memory>

namespace diracstep {

/// Where a step GL(s) keeps what its system is made of.
struct StageArrays {
  const Lagrangian* lagrangian;
  StagePoints* points;
  const double* p0;
  double *lq, *lv;                ///< ∂L/∂q and ∂L/∂v at the Gauss nodes
  double *lqq, *lqv, *lvv;        ///< second derivatives there, values
  const ConstraintRows* rows;     ///< the only block of rows; null for none
  double *at_lobatto, *at_gauss;  ///< A at the nodes, values
  double* offset;                 ///< b or φ at the nodes of the constraint
  double *curvature,
      *derivative;   ///< ∂(Aᵀλ)/∂q at the Lobatto nodes, ∂(A V + b)/∂q at the Gauss nodes, values
  double* impulses;  ///< Aᵀλ_j
};

/// The arithmetic of a step GL(s) whose numbers of coordinates, rows and stages are known when it is
/// compiled, on the arrays of a step that serves any numbers.
///
/// The equations are those of gauss_lobatto_step(), for a Lagrangian without force and one block of rows or
/// none.
class FixedStages {
 public:
  virtual ~FixedStages() = default;
  /// Nodes, first derivatives of L and impulses at x; gives the largest term of an impulse.
  virtual double evaluate(const double* x) = 0;
  /// f at x, after evaluate().
  virtual void residual(const double* x, double* f) = 0;
  /// The full Jacobian, by columns, from all second derivatives; `same` where those of L and the step size
  /// are the ones of the call before.
  virtual void jacobian(bool same, double* values) = 0;
  /// contract() at x, with the last correction in f; after the first evaluation it calls `prepare`, which is
  /// to call take_splitting().  Scales are those of the residual's two blocks, the first of which grows with
  /// the impulses: to the largest term of one and `beside_impulses`.
  struct Scales {
    double momentum, constraint, beside_impulses;
    bool moved = false;  ///< set where x has moved since it was evaluated last
  };
  virtual Contraction contract(double* x, double* f, const ContractionLimits& limits, Scales& scales,
                               const std::function<void()>& prepare) = 0;
  /// Takes the splitting of StageSplitting with M⁻¹, n×n, and A at the nodes.
  virtual void take_splitting(const double* inverse_mass) = 0;
  /// f ← P⁻¹ f; NaN where P is singular.
  virtual void solve_splitting(double* f) = 0;
};

/// Null where there is none for these numbers: above n = 4, m = 2 and s = 6.
std::unique_ptr<FixedStages> fixed_stages(const StageArrays& arrays);

}  // namespace diracstep
