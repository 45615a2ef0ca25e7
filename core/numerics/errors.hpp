#pragma once

#include <stdexcept>
#include <string>

namespace diracstep {

/// Misuse: a wrong name, size, value or start, found before anything is computed.  The message says what
/// was given and what is allowed.  Numerical failures are never exceptions; they are in the reports.
class Misuse : public std::invalid_argument {
 public:
  using std::invalid_argument::invalid_argument;
};

/// Throws Misuse unless `size` is `expected`.
void require_size(const std::string& what, long size, long expected);

/// Throws Misuse unless the step size is finite and not zero.
void require_step(double step);

}  // namespace diracstep
