#pragma once

#include <diracstep/core/steps/state.hpp>

namespace diracstep {

/// Where a motion crosses a kink of the scene's formulas.
struct KinkPassed {
  double time;
  State at;  ///< a round-off of the time behind it
};

}  // namespace diracstep
