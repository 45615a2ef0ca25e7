#include <diracstep/core/system/phase_function.hpp>
#include <stdexcept>

namespace diracstep {

void PhaseFunction::position_gradient_rate(double, ConstVectorRef, ConstVectorRef, VectorRef) const {
  throw std::logic_error(
      "a degenerate Lagrangian must supply position_gradient_rate, zero where it does not depend on the "
      "time");
}

}  // namespace diracstep
