#pragma once

#include <cstddef>
#include <diracstep/core/dirac/generating_function.hpp>
#include <diracstep/core/steps/state.hpp>

namespace diracstep {

/// One system of a step as it was solved: all that its derivatives are taken from.
struct SolvedStage {
  std::size_t part;  ///< 0 the step of the method, 1 that of its adjoint, where a composition takes both
  Interval step;
  State start;
  Vector x;  ///< the unknowns of that step
};

}  // namespace diracstep
