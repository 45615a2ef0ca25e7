#pragma once

#include <diracstep/core/numerics/types.hpp>

namespace diracstep {

/// Orthonormal bases of what some columns span, and of its complement.  Columns are scaled to length 1 first;
/// those below 1e-10 of the longest, and of the rank what lies below 1e-10, count as none.
struct OrthonormalBases {
  Columns span, complement;
};
OrthonormalBases orthonormal_bases(Columns columns);

}  // namespace diracstep
