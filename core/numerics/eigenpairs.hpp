#pragma once

#include <diracstep/core/numerics/types.hpp>
#include <functional>
#include <string>

namespace diracstep {

/// Eigenvalues θ of a linear map and their vectors, as columns.
struct Eigenpairs {
  Eigen::VectorXcd values;
  Eigen::MatrixXcd vectors;
  std::string failure = {};  ///< empty, or why there are fewer than were asked for
};

/// out = T in, of n numbers each.
using LinearMap = std::function<void(ConstVectorRef in, VectorRef out)>;

/// The `count` eigenpairs of largest |θ|, looked for in the spaces start, T start, T² start, …
using LargestEigenpairs =
    std::function<Eigenpairs(const LinearMap& map, const Vector& start, Eigen::Index count)>;

}  // namespace diracstep
