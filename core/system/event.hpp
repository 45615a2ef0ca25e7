#pragma once

#include <diracstep/core/numerics/types.hpp>
#include <functional>
#include <string>

namespace diracstep {

/// Something that happens where a function of the motion changes its sign.
struct Event {
  enum class Direction { both, rising, falling };

  std::string name;
  std::function<double(double t, ConstVectorRef q, ConstVectorRef v)>
      at;  ///< p in place of v without a Lagrangian
  Direction direction = Direction::both;
  bool stop = false;  ///< the run ends there; else it is noted
};

}  // namespace diracstep
