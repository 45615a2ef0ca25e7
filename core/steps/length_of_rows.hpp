#pragma once

#include <diracstep/core/system/scene.hpp>

namespace diracstep {

/// A length of the holonomic rows, from the start of the scene: their one-forms over the derivatives of
/// these, |A| / |∂(Aᵀ1)/∂q|, as 100 for (x − 100)² + y² = 100² in the origin.  The positions do not show it
/// there, but φ loses ε |A| times it to round-off.  0 where the rows are linear or there are none.
double length_of_rows(const Scene& scene);

}  // namespace diracstep
