#pragma once

#include <diracstep/core/numerics/types.hpp>
#include <functional>

namespace diracstep {

/// A point of a motion, as functions of the user's own read it.
struct MotionPoint {
  double t;
  const Vector &q, &v, &p;
  const Vector& lambda;  ///< forces of the rows; 0 for those that are switched off
};
using PointFunction = std::function<double(const MotionPoint&)>;

}  // namespace diracstep
