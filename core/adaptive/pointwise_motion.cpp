#include <diracstep/core/adaptive/pointwise_motion.hpp>
#include <diracstep/core/adaptive/rate_monitor.hpp>
#include <diracstep/core/numerics/errors.hpp>

namespace diracstep {

PointwiseMotion::PointwiseMotion(const Scene& scene, const SolverFactory& solvers, int dense_limit)
    : dense_(scene.dimension() + scene.rows() <= dense_limit),
      n_(scene.dimension()),
      velocity_problem_(std::make_unique<VelocityProblem>(scene, dense_)),
      acceleration_problem_(std::make_unique<AccelerationProblem>(scene, dense_)),
      factors_(dense_ ? n_ + scene.rows() : 0) {
  if (!has_accelerations(scene))
    throw Misuse(
        "scene '" + scene.name +
        "': its Lagrangian is linear in v, so there are no accelerations to choose variable steps by; use a "
        "fixed step");
  velocity_solver_ = solvers(*velocity_problem_);
  const int size = acceleration_problem_->size();
  if (dense_)
    matrix_.setZero(size, size);
  else
    acceleration_solver_ = solvers(*acceleration_problem_);
  velocity_unknowns_.setZero(size);
  unknowns_.setZero(size);
  right_hand_side_.setZero(size);
}

SolveReport PointwiseMotion::velocity(double t, ConstVectorRef q, ConstVectorRef p, Vector& v) {
  velocity_problem_->begin(t, q, p);
  velocity_solver_->reset();
  velocity_unknowns_.setZero();
  velocity_unknowns_.head(n_) = v;
  SolveReport report = velocity_solver_->solve(velocity_unknowns_);
  v = velocity_unknowns_.head(n_);
  return report;
}

SolveReport PointwiseMotion::acceleration(double t, ConstVectorRef q, ConstVectorRef v, VectorRef a) {
  ++accelerations_;
  acceleration_problem_->begin(t, q, v);
  unknowns_.setZero();
  SolveReport report;
  if (dense_) {
    acceleration_problem_->residual(unknowns_, right_hand_side_);
    acceleration_problem_->jacobian(unknowns_, matrix_.reshaped());
    factors_.compute(matrix_);
    unknowns_ = factors_.solve(-right_hand_side_);
    if (!unknowns_.allFinite()) report.status = SolveStatus::singular_jacobian;
  } else {
    acceleration_solver_->reset();
    report = acceleration_solver_->solve(unknowns_);
  }
  a = unknowns_.head(n_);
  return report;
}

}  // namespace diracstep
