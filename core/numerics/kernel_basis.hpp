#pragma once

#include <diracstep/core/numerics/types.hpp>

namespace diracstep {

/// A basis of the kernel of a matrix by elimination with full pivoting, without a column where there is none,
/// the identity where the matrix has no entries.  Pivots below `threshold` of the largest count as zero.
Columns kernel_basis(const Columns& matrix, double threshold);

/// The same of a matrix whose rows and columns each have their own unit, such as the slope of a diode that
/// blocks, 1e-12 A/V, beside 1: by pivots of the matrix after balance().  Entries below round-off of the
/// largest of their row count as zero.
Columns balanced_kernel_basis(Columns matrix, double threshold);

/// An orthonormal one, with the threshold of round-off; a column of zeros where there is none.
Columns orthonormal_kernel_basis(const Columns& matrix);

}  // namespace diracstep
