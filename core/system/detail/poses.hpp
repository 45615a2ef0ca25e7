#pragma once

#include <diracstep/core/spaces/space.hpp>
#include <diracstep/core/system/scene.hpp>
#include <optional>
#include <vector>

namespace diracstep {

/// The position of a start, all coordinates moved by this part of their size; on a space q τ(x), where x is
/// a velocity times a time; in R^n where `space` is null.
Vector moved_start(const Space* space, const Start& start, double distance);

/// A later instant, position and velocity in R^n near a start, of no special place; another for each phase.
Start near_start(const Start& start, double phase);

/// φ of holonomic rows, one block after the other.
void positions_of(const ConstraintBlocks& holonomic, double t, ConstVectorRef q, VectorRef phi);

/// A point of the holonomic rows near q that differs from it in what is not `held`, by Gauss and Newton's
/// method in least squares, so that the rows may depend on each other; nothing where it does not converge.
std::optional<Vector> pose_near(const Space* space, const ConstraintBlocks& holonomic, double t, Vector q,
                                const std::vector<int>& held);

}  // namespace diracstep
