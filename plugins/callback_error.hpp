#pragma once

#include <diracstep/core/numerics/errors.hpp>
#include <exception>
#include <string>

namespace diracstep {

/// A callback of a plugin or of a program in another language returned an error or threw.  Says whose
/// callback it was, which one, and what it said.
class CallbackError : public Error {
 public:
  using Error::Error;
};

/// Throws Misuse, which names the plugin or program, where what it has registered is not fit for use.
inline void require(bool condition, const std::string& owner, const std::string& what) {
  if (!condition) throw Misuse(owner + ": " + what);
}

/// Calls `callback()`, which returns 0 or an error number.  `explain(status)` tells what the number means.
template <class Callback, class Explain>
void call(const std::string& owner, const char* what, Callback callback, Explain explain) {
  int status = 0;
  try {
    status = callback();
  } catch (const std::exception& error) {
    throw CallbackError(owner + ": " + what + " threw: " + error.what());
  } catch (...) {
    throw CallbackError(owner + ": " + what + " threw something that is no std::exception");
  }
  if (status == 0) return;
  const std::string meaning = explain(status);
  throw CallbackError(owner + ": " + what + " returned error " + std::to_string(status) +
                      (meaning.empty() ? "" : ": " + meaning));
}

template <class Callback>
void call(const std::string& owner, const char* what, Callback callback) {
  call(owner, what, callback, [](int) { return std::string(); });
}

}  // namespace diracstep
