#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <sstream>

namespace diracstep {

void require_size(const std::string& what, long size, long expected) {
  if (size == expected) return;
  throw Misuse(what + " has " + std::to_string(size) + " entries; expected " + std::to_string(expected));
}

void require_step(double step) {
  if (std::isfinite(step) && step != 0.0) return;
  std::ostringstream message;
  message << "the step size is " << step << "; a finite number other than zero is needed";
  throw Misuse(message.str());
}

}  // namespace diracstep
