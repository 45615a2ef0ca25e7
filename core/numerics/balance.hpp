#pragma once

#include <diracstep/core/numerics/types.hpp>

namespace diracstep {

/// What the rows and the columns of a matrix have been multiplied by.
struct Balance {
  Vector rows, columns;
};

/// Scales the rows and columns of a matrix until the largest entry of each is about 1; those without entries
/// stay as they are.  D. Ruiz, A scaling algorithm to equilibrate both rows and columns norms in matrices,
/// RAL-TR-2001-034.
Balance balance(Columns& matrix);

}  // namespace diracstep
