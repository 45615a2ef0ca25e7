#pragma once

#include <cmath>
#include <diracstep/boundary_values/optimal_control.hpp>
#include <limits>

#include "solved.hpp"

namespace diracstep::testing {

inline constexpr double unbounded = std::numeric_limits<double>::infinity();

#define NEEDS_IPOPT() \
  if (!optimal_control_available()) GTEST_SKIP() << "not checked: built without Ipopt"

/// q or v of one end by number, of (q, v).
using EndValues = std::vector<std::pair<int, double>>;

inline BoundaryConditions conditions_on(int n, const EndValues& start, const EndValues& end) {
  const auto rows = static_cast<Eigen::Index>(start.size() + end.size());
  BoundaryConditions conditions{Columns::Zero(rows, 3L * n), Columns::Zero(rows, 3L * n), Vector(rows)};
  Eigen::Index row = 0;
  for (const auto& [i, value] : start) {
    conditions.at_start(row, i) = 1.0;
    conditions.value[row++] = value;
  }
  for (const auto& [i, value] : end) {
    conditions.at_end(row, i) = 1.0;
    conditions.value[row++] = value;
  }
  return conditions;
}

inline ControlProblem problem_of(const ControlledScene& controlled, const IntegratorOptions& options,
                                 long count, const BoundaryConditions& conditions, const Vector& from,
                                 const Vector& to) {
  static const Registry registry = Registry::with_built_ins();
  const double t0 = controlled.scene->start.time;
  return {controlled,
          registry,
          kinsol(),
          options,
          count,
          conditions,
          straight_line(t0, from, t0 + static_cast<double>(count) * options.step, to)};
}

}  // namespace diracstep::testing
