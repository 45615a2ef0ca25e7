#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/system/phase_function.hpp>

namespace diracstep {

void PhaseFunction::gradients(const PointColumns& at, double* fx, double* fy) const {
  const Eigen::Index n = dimension();
  for (int i = 0; i < at.count; ++i)
    gradient(at.times[i], column(at.x, n, i), column(at.y, n, i), column(fx, n, i), column(fy, n, i));
}

void PhaseFunction::hessians(const PointColumns& at, double* fxx, double* fxy, double* fyy) const {
  const Eigen::Index n = dimension(), entries = pattern().nonzeros();
  for (int i = 0; i < at.count; ++i)
    hessian(at.times[i], column(at.x, n, i), column(at.y, n, i), column(fxx, entries, i),
            column(fxy, entries, i), column(fyy, entries, i));
}

void PhaseFunction::position_gradient_rate(double, ConstVectorRef, ConstVectorRef, VectorRef) const {
  throw Misuse(
      "a degenerate Lagrangian must supply position_gradient_rate, zero where it does not depend on the "
      "time");
}

}  // namespace diracstep
