#pragma once

#include <diracstep/core/system/constraint_rows.hpp>
#include <memory>
#include <string>

namespace diracstep {

/// The rows c A v + c b = 0, c φ = 0: the same constraint in other units.  `suffix` is added to the rows'
/// names.  Throws Misuse for a factor that is zero or not finite.
std::shared_ptr<const ConstraintRows> scaled_rows(std::shared_ptr<const ConstraintRows> rows, double factor,
                                                  const std::string& suffix);

}  // namespace diracstep
