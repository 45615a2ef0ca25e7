#pragma once

#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <string>
#include <vector>

namespace diracstep::command {

/// The parts of "a,b,c".  All of these throw Misuse with the option, the value given and what is allowed.
std::vector<std::string> names(const std::string& option, const std::string& list);
std::vector<double> numbers(const std::string& option, const std::string& list);
std::vector<int> whole_numbers(const std::string& option, const std::string& list);

/// "name=value" assignments.
Parameters parameters(const std::vector<std::string>& assignments, const std::string& option = "--set");

/// "plus", "minus" or "projected".
Momentum momentum(const std::string& text);

}  // namespace diracstep::command
