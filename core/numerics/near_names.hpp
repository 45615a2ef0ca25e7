#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace diracstep {

/// The known name that is at most a third of the letters away (Levenshtein's distance, where neighbours that
/// changed places count as one), or the only one that `name` begins; else empty.
std::string near_name(std::string_view name, const std::vector<std::string>& known);

/// The same for messages about an unknown name: " (did you mean 'NAME'?)", or empty.
std::string did_you_mean(std::string_view name, const std::vector<std::string>& known);

}  // namespace diracstep
