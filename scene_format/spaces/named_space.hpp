#pragma once

#include <diracstep/core/spaces/space.hpp>
#include <memory>
#include <string>
#include <vector>

namespace diracstep {

/// The product of factors by their names (factor_texts.hpp), in this order, with exponentials.
std::shared_ptr<const Space> named_space(const std::vector<std::string>& kinds);

}  // namespace diracstep
