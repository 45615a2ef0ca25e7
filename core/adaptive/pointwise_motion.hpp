#pragma once

#include <diracstep/core/integrator/point_reader.hpp>
#include <diracstep/core/numerics/nonlinear_solver.hpp>
#include <diracstep/core/spaces/space.hpp>
#include <diracstep/core/system/scene.hpp>

namespace diracstep {

/// Velocities and accelerations of a scene at given points, as the monitor takes them: counted, and for few
/// unknowns by elimination.  Allocates nothing once made.
class PointwiseMotion {
 public:
  /// Throws Misuse for a Lagrangian that is linear in v, which has no accelerations.
  PointwiseMotion(const Scene& scene, const SolverFactory& solvers, int dense_limit = 40);

  /// v ∈ Δ_Q(q) of the class of p, from a guess in v.
  SolveReport velocity(double t, ConstVectorRef q, ConstVectorRef p, Vector& v) {
    return reader_.velocity(t, q, p, v);
  }

  /// The acceleration a of the continuous system at (q, v).  Linear; dense systems are solved directly.
  SolveReport acceleration(double t, ConstVectorRef q, ConstVectorRef v, VectorRef a);

  /// Null in R^n.
  const Space* space() const { return space_.get(); }

  long accelerations() const { return accelerations_; }

 private:
  bool full_;
  std::shared_ptr<const Space> space_;
  PointReader reader_;
  Vector acceleration_, forces_;
  long accelerations_ = 0;
};

}  // namespace diracstep
