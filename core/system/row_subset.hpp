#pragma once

#include <diracstep/core/system/scene.hpp>
#include <memory>
#include <string>
#include <vector>

namespace diracstep {

/// The same scene without the rows of these names.
std::shared_ptr<const Scene> without_rows(const Scene& scene, const std::vector<std::string>& names);

/// Some rows of a block, by ascending numbers; `constant` is what is known of these.
std::shared_ptr<const ConstraintRows> rows_of_block(const std::shared_ptr<const ConstraintRows>& block,
                                                    const std::vector<int>& kept, bool constant);

}  // namespace diracstep
