#pragma once

#include <stdexcept>
#include <string>

namespace diracstep {

/// What every exception of the library derives from: misuse, a file that cannot be written, a library below
/// that refuses its work, an error of a plugin.  Numerical failures are never exceptions; they are in the
/// reports.  What passes through unchanged is not of this type: exceptions of the user's own functions, and
/// std::bad_alloc.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A wrong name, size, value or start, found before anything is computed.  The message says what was given
/// and what is allowed.
class Misuse : public Error {
 public:
  using Error::Error;
};

/// Throws Misuse unless `size` is `expected`.
void require_size(const std::string& what, long size, long expected);

/// A number for a message, in so many digits.
std::string to_text(double value, int digits = 6);

/// Throws Misuse unless the step size is finite and not zero.
void require_step(double step);

}  // namespace diracstep
