#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <sstream>

namespace diracstep {

void require_size(const std::string& what, long size, long expected) {
  if (size == expected) return;
  throw Misuse(what + " has " + std::to_string(size) + " entries; expected " + std::to_string(expected));
}

std::string to_text(double value, int digits) {
  std::ostringstream text;
  text.precision(digits);
  text << value;
  return text.str();
}

void require_step(double step) {
  if (std::isfinite(step) && step != 0.0) return;
  throw Misuse("the step size is " + to_text(step) + "; a finite number other than zero is needed");
}

}  // namespace diracstep
