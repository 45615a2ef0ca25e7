#pragma once

#include <diracstep/core/system/scene.hpp>
#include <memory>
#include <string>
#include <vector>

namespace diracstep {

/// The same scene without the rows of these names.
std::shared_ptr<const Scene> without_rows(const Scene& scene, const std::vector<std::string>& names);

}  // namespace diracstep
