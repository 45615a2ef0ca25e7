#pragma once

#include <diracstep/core/numerics/types.hpp>

namespace diracstep {

/// Several points of a scene side by side: n×count columns of positions and, where they are read, of
/// velocities or momenta, each column behind the one before, and the time of each point.
struct PointColumns {
  int count;
  const double* times;
  const double* x;
  const double* y = nullptr;
};

/// Column i of columns of n numbers.
inline Eigen::Map<const Vector> column(const double* columns, Eigen::Index n, int i) {
  return {columns + n * i, n};
}
inline Eigen::Map<Vector> column(double* columns, Eigen::Index n, int i) { return {columns + n * i, n}; }

}  // namespace diracstep
