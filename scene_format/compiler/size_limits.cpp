#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/scene_format/compiler/size_limits.hpp>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>

namespace diracstep::scene_compiler {

namespace {

constexpr std::array<std::pair<std::string_view, std::size_t SizeLimits::*>, 10> names{
    {{"file_bytes", &SizeLimits::file_bytes},
     {"key_parts", &SizeLimits::key_parts},
     {"graph_nodes", &SizeLimits::graph_nodes},
     {"graph_visits", &SizeLimits::graph_visits},
     {"sum_terms", &SizeLimits::sum_terms},
     {"derivatives", &SizeLimits::derivatives},
     {"repeated", &SizeLimits::repeated},
     {"entries", &SizeLimits::entries},
     {"coordinates", &SizeLimits::coordinates},
     {"source_bytes", &SizeLimits::source_bytes}}};
constexpr double largest = 1e15;

void set(SizeLimits& limits, std::string_view assignment) {
  const std::size_t sign = std::min(assignment.find('='), assignment.size());
  const std::string_view name = assignment.substr(0, sign),
                         text = assignment.substr(std::min(sign + 1, assignment.size()));
  double value = 0.0;
  const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool whole = error == std::errc() && stop == text.data() + text.size() &&
                     value == std::floor(value) && value >= 1.0 && value <= largest;
  std::string known;
  for (const auto& [key, member] : names) {
    if (key == name && whole) return void(limits.*member = static_cast<std::size_t>(value));
    known += fmt::format(" {}", key);
  }
  throw Misuse(
      fmt::format("DIRACSTEP_LIMITS: '{}' is not NAME=WHOLE NUMBER from 1 to {:g}, with one of the names{}",
                  assignment, largest, known));
}

}  // namespace

SizeLimits size_limits() {
  SizeLimits limits;
  const char* const given = std::getenv("DIRACSTEP_LIMITS");
  if (given == nullptr) return limits;
  std::istringstream list(given);
  for (std::string assignment; std::getline(list, assignment, ',');) set(limits, assignment);
  return limits;
}

}  // namespace diracstep::scene_compiler
