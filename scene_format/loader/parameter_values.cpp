#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/scene_format/loader/parameter_values.hpp>

namespace diracstep {

using namespace scene_compiler;

const SceneDocument::Parameter* find_parameter(const SceneDocument& document, const std::string& name) {
  const auto found = std::ranges::find(document.parameters, name, &SceneDocument::Parameter::name);
  return found == document.parameters.end() || found->array ? nullptr : &*found;
}

namespace {

/// A parameter, or an element of an array of them.
struct ParameterElement {
  const SceneDocument::Parameter* parameter = nullptr;
  std::size_t index = 0;
};

/// By "m" or, for an array, "m[2]"; elements count from 1.
ParameterElement find_element(const SceneDocument& document, const std::string& name) {
  const std::size_t bracket = name.find('[');
  if (bracket == std::string::npos) return {find_parameter(document, name)};
  const auto found =
      std::ranges::find(document.parameters, name.substr(0, bracket), &SceneDocument::Parameter::name);
  unsigned long number = 0;
  const char *const first = name.data() + bracket + 1, *const last = name.data() + name.size() - 1;
  if (found == document.parameters.end() || !found->array || !name.ends_with(']')) return {};
  const auto [end, failure] = std::from_chars(first, last, number);
  if (failure != std::errc() || end != last || number < 1 || number > found->values.size()) return {};
  return {&*found, number - 1};
}

ParameterElement required_element(const SceneDocument& document, const std::string& name, double value) {
  const ParameterElement element = find_element(document, name);
  const SceneDocument::Parameter* parameter = element.parameter;
  if (parameter == nullptr) {
    std::string known;
    for (const auto& other : document.parameters)
      known += ' ' + other.name + (other.array ? fmt::format("[1..{}]", other.values.size()) : "");
    throw Misuse(fmt::format("scene '{}' has no parameter '{}'; its parameters are{}", document.name, name,
                             known.empty() ? " none" : known));
  }
  if (!std::isfinite(value))
    throw Misuse(
        fmt::format("scene '{}': parameter {} = {}; a finite number is needed", document.name, name, value));
  if (!parameter->limits.allow(value))
    throw Misuse(fmt::format("scene '{}': {} {} = {:g}; it must be {}", document.name,
                             parameter->size ? "size" : "parameter", name, value, parameter->limits.text()));
  if (parameter->size && value != std::floor(value))
    throw Misuse(
        fmt::format("scene '{}': size {} = {:g}; a whole number is needed", document.name, name, value));
  return element;
}

}  // namespace

ParameterValues parameter_values(const SceneDocument& document,
                                 const std::map<std::string, double>& changes) {
  ParameterValues values;
  for (const auto& parameter : document.parameters) values.push_back(parameter.values);
  for (const auto& [name, value] : changes) {
    const ParameterElement element = required_element(document, name, value);
    values[static_cast<std::size_t>(element.parameter - document.parameters.data())][element.index] = value;
  }
  return values;
}

}  // namespace diracstep
