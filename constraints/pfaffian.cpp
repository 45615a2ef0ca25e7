#include <diracstep/constraints/pfaffian.hpp>

namespace diracstep::detail {

std::vector<std::string> row_names(std::vector<std::string> names, int rows) {
  if (names.empty())
    for (int r = 1; r <= rows; ++r) names.push_back(std::to_string(r));
  return names;
}

}  // namespace diracstep::detail
