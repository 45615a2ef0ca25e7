#pragma once

#include <diracstep/core/numerics/types.hpp>

namespace diracstep {

/// The space that columns of largest entry 1 span, by columns with fewer entries, such as loops of a circuit
/// around one mesh each.  Entries of sums of two below `zero` are none.
Columns fewer_entries(Columns basis, double zero);

}  // namespace diracstep
