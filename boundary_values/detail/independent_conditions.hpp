#pragma once

#include <diracstep/boundary_values/boundary_values.hpp>

namespace diracstep::boundary {

/// The conditions without those that follow from the rows of the scene at both ends and from conditions
/// before them, judged where the guess is, with what the conditions say of q and v there.
BoundaryConditions independent_conditions(const std::shared_ptr<const Scene>& scene,
                                          const BoundaryConditions& conditions, double start_time,
                                          double end_time, const GuessedPoint& start,
                                          const GuessedPoint& end);

}  // namespace diracstep::boundary
