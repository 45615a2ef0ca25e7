#pragma once

#include <functional>

namespace diracstep::command {

/// The processes that mpirun started this command as; one where it did not.
struct Processes {
  int number = 0, count = 1;
  std::function<long()> draw = {};  ///< the next number, from 0, that none of them has drawn
  std::function<void()> meet = {};  ///< returns once all have called it
};

}  // namespace diracstep::command
