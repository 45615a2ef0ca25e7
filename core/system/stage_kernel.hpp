#pragma once

#include <diracstep/core/system/constraint_rows.hpp>

namespace diracstep {

/// What a stage kernel reads and writes.  The same struct stands, as text, at the top of every generated
/// source (scene_format/compiler/stage_kernel.cpp).
///
/// Columns of points and of values on patterns as in StageArrays; the weights of a sum over stages stand with
/// those of one x_k side by side: Σ_k position[s k + i] x_k.
struct StageKernelCall {
  // Of the scene and the step.
  const double* known;  ///< StageKernel::known
  const double *q0, *p0;
  const double *position, *lobatto, *force, *impulse;  ///< h a_ik, h a~_{i+1,k}, −h â_ik, −e_ik
  double per_step;                                     ///< 1/h
  // The unknowns, and all at them that the residual is made of.
  double* x;
  double *gauss, *lobatto_points;  ///< Q_i, and Q~_j from j = 0 on
  double *lq, *lv;                 ///< ∂L/∂q and ∂L/∂v at the Gauss nodes
  double *at_lobatto, *at_gauss;   ///< A at the nodes; at Q~_0 it is read
  double* impulses;                ///< Aᵀλ_j
  double* f;                       ///< the residual, or the last correction of x
  double largest_impulse;          ///< largest term of an impulse
  double momentum, constraint;     ///< largest entries of f, infinite where one is no number
  // The iteration x ← x − P⁻¹F with the splitting of StageSplitting.
  void* owner;
  int (*next)(void* owner);                  ///< what follows an evaluation: Next; null for Next::stop
  void (*solve_rows)(void* owner, double*);  ///< the matrix of the multipliers
  const double *inverse_mass, *constraint_forms, *through_mass;  ///< M⁻¹, A_j and M⁻¹ A(Q~_l)ᵀ, node by node
  const double *by_constraint, *by_impulse;                      ///< C_jk, e_jk

  enum Next : int { stop, correct, correct_and_stop };
};

/// The residual of a step GL(s) in one function, with all that it is made of and the iteration around it,
/// compiled for one scene and one number of stages; with the same bits as FixedStages from the derivatives of
/// L and the rows.
struct StageKernel {
  void (*run)(void* call) = nullptr;  ///< takes a StageKernelCall; null where there is none
  const double* known = nullptr;
};

/// Of a Lagrangian, beside it: one that comes with such functions.
class StageKernelSource {
 public:
  StageKernelSource() = default;
  StageKernelSource(const StageKernelSource&) = delete;
  StageKernelSource& operator=(const StageKernelSource&) = delete;
  virtual ~StageKernelSource() = default;

  /// Evaluations that take as long as it takes to compile a kernel, some tenths of a second.
  static constexpr long evaluations_worth_a_kernel = 1'000'000;
  /// The function for L with these rows, which may be null, and no force.  It lives as long as the
  /// Lagrangian.  `evaluations` have been done without it since the last call: those of all steps with so
  /// many stages, in whatever run of the scene's file, are added up, and decide whether one is compiled that
  /// is not there.  May be called from several threads at once; one that finds another compiling goes on
  /// without.
  virtual StageKernel stage_kernel(const ConstraintRows* rows, int stages, long evaluations) const = 0;
};

}  // namespace diracstep
