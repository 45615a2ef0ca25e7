#pragma once

namespace diracstep {

/// What the solve of a step begins from.
enum class Guess {
  predicted,     ///< from the last solutions, or plain where they are too few
  plain,         ///< from the velocity at the start
  last_solution  ///< what stands in the unknowns
};

/// Where steps go on from when there is no history.
enum class Origin {
  start,  ///< a start: the first solution is compared with that of half the step
  motion  ///< a point of a motion under way, whose velocity is near that of the next step
};

}  // namespace diracstep
