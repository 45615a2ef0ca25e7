#pragma once

#include <diracstep/core/numerics/types.hpp>

namespace diracstep {

/// A basis of the kernel of a matrix by elimination with full pivoting, without a column where there is none,
/// the identity where the matrix has no entries.  Pivots below `threshold` of the largest count as zero.
Columns kernel_basis(const Columns& matrix, double threshold);

/// An orthonormal one, with the threshold of round-off; a column of zeros where there is none.
Columns orthonormal_kernel_basis(const Columns& matrix);

}  // namespace diracstep
