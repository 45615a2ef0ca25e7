#pragma once

#include <diracstep/core/numerics/types.hpp>
#include <diracstep/core/spaces/space.hpp>

namespace diracstep {

/// Columns and matrices of a Lie algebra whose dimension D is known when a step is compiled, 3 or 6, or is
/// Eigen::Dynamic: products of 3×3 matrices of sizes that are known late take several times as long.
template <int D>
struct GroupSizes {
  using Column = Eigen::Matrix<double, D, 1>;
  using Square = Eigen::Matrix<double, D, D>;
  using Stages = Eigen::Matrix<double, D, Eigen::Dynamic>;  ///< a column for each stage
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, D>;    ///< a row for each constraint
};

/// A matrix or column over the components of velocities as one over group columns, others zero.
template <class Square>
void embed_block(const Space& space, const Columns& of_velocities, Square& whole) {
  whole.setZero();
  whole(space.tangent(), space.tangent()) = of_velocities;
}

}  // namespace diracstep
