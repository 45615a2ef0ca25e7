#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace diracstep {

/// The known name that is at most a third of the letters away (Levenshtein's distance, where neighbours that
/// changed places count as one), or the only one that `name` begins; else empty.
std::string near_name(std::string_view name, const std::vector<std::string>& known);

/// The same for messages about an unknown name: " (did you mean 'NAME'?)", or empty.
std::string did_you_mean(std::string_view name, const std::vector<std::string>& known);

/// "'a', 'b' and 3 more": the first `most` of them, each in quotation marks unless `quote` is empty.
std::string name_list(const std::vector<std::string>& names, std::size_t most = 50,
                      std::string_view quote = "'");

}  // namespace diracstep
