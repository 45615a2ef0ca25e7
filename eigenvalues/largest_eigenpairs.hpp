#pragma once

#include <diracstep/core/numerics/eigenpairs.hpp>

namespace diracstep {

/// The eigenpairs of largest |θ| by implicitly restarted Arnoldi iterations of Spectra, to a residual of
/// 1e-12 |θ|.  The map has at least count + 2 numbers.  Of equal eigenvalues some may be missed.  Throws
/// Misuse where the library was built without Spectra.
Eigenpairs largest_eigenpairs(const LinearMap& map, const Vector& start, Eigen::Index count);

}  // namespace diracstep
