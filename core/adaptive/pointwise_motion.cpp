#include <diracstep/core/adaptive/pointwise_motion.hpp>
#include <diracstep/core/adaptive/rate_monitor.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <memory>

namespace diracstep {

PointwiseMotion::PointwiseMotion(const Scene& scene, const SolverFactory& solvers, int dense_limit)
    : full_(scene.dimension() + scene.rows() <= dense_limit),
      space_(scene.space),
      reader_(std::make_shared<const Scene>(scene), solvers, full_) {
  if (!has_accelerations(scene))
    throw Misuse("scene '" + scene.name + "': " + why_no_accelerations(scene) +
                 ", so there are no accelerations to choose variable steps by; use a fixed step");
}

SolveReport PointwiseMotion::acceleration(double t, ConstVectorRef q, ConstVectorRef v, VectorRef a) {
  ++accelerations_;
  if (full_) return reader_.acceleration_by_elimination(t, q, v, a);
  const SolveReport report = reader_.acceleration(t, q, v, acceleration_, forces_);
  a = acceleration_;
  return report;
}

}  // namespace diracstep
