#pragma once

#include <diracstep/core/spaces/space.hpp>
#include <diracstep/core/system/scene.hpp>
#include <optional>
#include <vector>

namespace diracstep {

/// moved() and pose_near() of redundant_rows.hpp on a space, where q moves by q τ(x) and x is a velocity
/// times a time; without one in R^n.
Vector moved_on(const Space* space, const Start& start, double distance);
std::optional<Vector> pose_near_on(const Space* space, const ConstraintBlocks& holonomic, double t, Vector q,
                                   const std::vector<int>& held);

}  // namespace diracstep
