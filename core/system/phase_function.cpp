#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/system/phase_function.hpp>

namespace diracstep {

void PhaseFunction::position_gradient_rate(double, ConstVectorRef, ConstVectorRef, VectorRef) const {
  throw Misuse(
      "a degenerate Lagrangian must supply position_gradient_rate, zero where it does not depend on the "
      "time");
}

}  // namespace diracstep
