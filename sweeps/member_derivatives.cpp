#include <fmt/format.h>

#include <algorithm>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/scene_format/parametric_scene_file.hpp>
#include <diracstep/sweeps/member_derivatives.hpp>
#include <limits>

namespace diracstep {

namespace {

/// "d(a)/d(b)" as a and b; both empty where the text is none.
std::pair<std::string, std::string> parts_of_derivative(const std::string& text) {
  const std::string between = ")/d(";
  const std::size_t middle = text.find(between);
  if (!text.starts_with("d(") || !text.ends_with(")") || middle == std::string::npos) return {};
  const std::size_t second = middle + between.size();
  return {text.substr(2, middle - 2), text.substr(second, text.size() - 1 - second)};
}

void require_derivatives(const Sweep& sweep, const CatalogueScene& entry) {
  const auto names = sweep.names();
  const char* reason =
      sweep.error             ? "'error'"
      : sweep.project         ? "'project'"
      : !entry.events.empty() ? "the events of the scene"
      : std::ranges::any_of(names, [](const auto& name) { return name.starts_with("start."); })
          ? "starts that vary"
          : nullptr;
  if (reason != nullptr)
    throw Misuse(
        fmt::format("[record]: 'derivatives' are of fixed steps from the scene's own start and do not "
                    "go with {}",
                    reason));
}

}  // namespace

DerivativeNames::DerivativeNames(const Sweep& sweep, const CatalogueScene& entry) {
  if (sweep.derivatives.empty()) return;
  require_derivatives(sweep, entry);
  for (const std::string& text : sweep.derivatives) {
    const auto [value, parameter] = parts_of_derivative(text);
    const auto& coordinates = entry.scene->coordinates;
    auto found = std::ranges::find(coordinates, value);
    const bool velocity = found == coordinates.end() && value.starts_with("v_");
    if (velocity) found = std::ranges::find(coordinates, value.substr(2));
    if (found == coordinates.end() || !entry.parameters.contains(parameter))
      throw Misuse(
          fmt::format("[record]: '{}': expected d(x)/d(m) or d(v_x)/d(m) of a coordinate x and a "
                      "parameter m of the scene '{}'",
                      text, entry.scene->name));
    auto by = std::ranges::find(parameters_, parameter);
    if (by == parameters_.end()) by = parameters_.insert(by, parameter);
    all_.push_back({velocity, found - coordinates.begin(), by - parameters_.begin()});
  }
}

MemberDerivatives::MemberDerivatives(const Sweep& sweep, const CatalogueScene& entry,
                                     const Parameters& changes, const Registry& registry,
                                     Integrator& integrator)
    : names_(sweep, entry),
      scene_(parametric_scene(sweep.scene, entry, names_.parameters(), changes)),
      sensitivities_(integrator, registry, scene_),
      directions_(sensitivities_.by_parameters()) {}

std::vector<double> MemberDerivatives::numbers() {
  const ReadDirections read = sensitivities_.read(directions_);
  std::vector<double> values;
  for (const auto& [velocity, coordinate, parameter] : names_.all()) {
    const Columns& columns = velocity ? read.v : read.q;
    values.push_back(columns.size() > 0 ? columns(coordinate, parameter)
                                        : std::numeric_limits<double>::quiet_NaN());
  }
  return values;
}

}  // namespace diracstep
