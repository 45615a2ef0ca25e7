#pragma once

#include <functional>
#include <span>
#include <vector>

namespace diracstep::command {

/// Numbers for another process and numbers from it, as many as both of them know.
struct Exchanged {
  int with;
  std::span<const double> out;
  std::span<double> in;
};

/// The processes that mpirun started this command as; one where it did not, without functions.
struct Processes {
  int number = 0, count = 1;
  std::function<long()> draw = {};  ///< the next number, from 0, that none of them has drawn
  std::function<void()> meet = {};  ///< returns once all have called it
  std::function<void(std::span<const Exchanged>)> exchange = {};  ///< called by all, with each other
  std::function<std::vector<double>(double)> gather = {};         ///< called by all: everyone's number
};

}  // namespace diracstep::command
