#pragma once

#include <Eigen/LU>
#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <diracstep/core/system/saddle_point.hpp>
#include <memory>

namespace diracstep {

/// Velocities and accelerations of a scene at given points.  Owns what it needs; allocates nothing once made.
class PointwiseMotion {
 public:
  /// Throws Misuse for a Lagrangian that is linear in v, which has no accelerations.
  PointwiseMotion(const Scene& scene, const SolverFactory& solvers, int dense_limit = 40);

  /// v ∈ Δ_Q(q) of the class of p, from a guess in v.
  SolveReport velocity(double t, ConstVectorRef q, ConstVectorRef p, Vector& v);

  /// The acceleration a of the continuous system at (q, v).  Linear; dense systems are solved directly.
  SolveReport acceleration(double t, ConstVectorRef q, ConstVectorRef v, VectorRef a);

  long accelerations() const { return accelerations_; }

 private:
  bool dense_;
  Eigen::Index n_;
  std::unique_ptr<VelocityProblem> velocity_problem_;
  std::unique_ptr<AccelerationProblem> acceleration_problem_;
  std::unique_ptr<NonlinearSolver> velocity_solver_, acceleration_solver_;
  Eigen::PartialPivLU<Eigen::MatrixXd> factors_;
  Columns matrix_;
  Vector velocity_unknowns_, unknowns_, right_hand_side_;
  long accelerations_ = 0;
};

}  // namespace diracstep
