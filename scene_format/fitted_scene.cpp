#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/names.hpp>
#include <diracstep/scene_format/fitted_scene.hpp>
#include <diracstep/scene_format/parametric_scene_file.hpp>
#include <diracstep/scene_format/position_names.hpp>
#include <diracstep/scene_format/scene_file.hpp>

namespace diracstep {

namespace {

/// Columns of a trajectory that nothing is fitted to.
bool is_left_alone(const std::string& name) {
  return name == "energy" || std::ranges::any_of(std::array{"p_", "lambda_", "invariant_", "d("},
                                                 [&](const char* start) { return name.starts_with(start); });
}

std::vector<std::string> fittable(const CatalogueScene& entry) {
  std::vector<std::string> names;
  for (const char* prefix : {"", "v_"})
    for (const std::string& name : entry.scene->coordinates) names.push_back(prefix + name);
  for (const Output& output : entry.outputs) names.push_back(output.name);
  return names;
}

Parameters with(const FittedScene& of, const Vector& values) {
  Parameters all = of.changes;
  for (std::size_t k = 0; k < of.parameters.size(); ++k)
    all[of.parameters[k]] = values[static_cast<Eigen::Index>(k)];
  return all;
}

CatalogueScene made(const FittedScene& of, const Parameters& all) {
  return of.text ? scene_from_text(of.name, *of.text, all) : make_scene(of.name, all);
}

}  // namespace

Vector fit_start(const FittedScene& of, const CatalogueScene& entry) {
  require_flat(*entry.scene, "fit");
  if (!entry.events.empty())
    throw Misuse("fit does not go with the events of the scene: when one is met is not differentiated");
  Vector values(static_cast<Eigen::Index>(of.parameters.size()));
  for (std::size_t k = 0; k < of.parameters.size(); ++k) {
    const auto found = entry.parameters.find(of.parameters[k]);
    if (found == entry.parameters.end())
      throw Misuse(
          fmt::format("--parameters: scene '{}' has no parameter '{}'", entry.scene->name, of.parameters[k]));
    values[static_cast<Eigen::Index>(k)] = found->second;
  }
  return values;
}

FitProblem fit_problem(const FittedScene& of, const Registry& registry, SolverFactory solvers,
                       IntegratorOptions steps) {
  FitProblem problem{{}, registry, std::move(solvers), std::move(steps)};
  problem.scene = [of](const Vector& values) {
    const Parameters all = with(of, values);
    const CatalogueScene entry = made(of, all);
    return of.text ? parametric_scene_from_text(of.name, *of.text, entry, of.parameters, all)
                   : parametric_scene(of.name, entry, of.parameters, all);
  };
  problem.outputs = [of](const Vector& values) {
    std::vector<PointFunction> functions;
    for (Output& output : made(of, with(of, values)).outputs) functions.push_back(std::move(output.at));
    return functions;
  };
  return problem;
}

FitData fit_data(const CsvTable& table, const std::string& from, const CatalogueScene& entry,
                 const Parameters& sigma) {
  const Scene& scene = *entry.scene;
  if (table.lines.empty()) throw Misuse(fmt::format("{} has no lines of data", from));
  if (table.names.empty()) throw Misuse(fmt::format("{}: the first line does not name the columns", from));
  if (table.names.front() != "t")
    throw Misuse(fmt::format("{}: the first column is '{}'; expected t", from, table.names.front()));
  const std::vector<std::string> known = fittable(entry);
  FitData data;
  std::vector<std::size_t> used;
  Parameters left = sigma;
  for (std::size_t c = 1; c < table.names.size(); ++c) {
    const std::string& name = table.names[c];
    const auto here = table.names.begin() + static_cast<std::ptrdiff_t>(c);
    if (std::find(table.names.begin(), here, name) != here)
      throw Misuse(fmt::format("{}: two columns are named '{}'", from, name));
    const auto found = std::ranges::find(known, name);
    if (found == known.end()) {
      if (is_left_alone(name)) continue;
      throw Misuse(fmt::format("{}: the column '{}' is no coordinate, velocity or output of scene '{}'{}",
                               from, name, scene.name, did_you_mean(name, known)));
    }
    const auto number = static_cast<int>(found - known.begin());
    const int n = scene.dimension();
    const auto given = left.find(name);
    const double deviation = given != left.end() ? given->second : 1.0;
    if (number < 2 * n)
      data.columns.push_back({number % n, number >= n, deviation});
    else
      data.columns.push_back({0, false, deviation, number - 2 * n});
    if (given != left.end()) left.erase(given);
    used.push_back(c);
  }
  if (used.empty())
    throw Misuse(
        fmt::format("{} has no column of a coordinate, velocity or output of scene '{}'", from, scene.name));
  if (!left.empty()) throw Misuse(fmt::format("--sigma: '{}' is no column of {}", left.begin()->first, from));
  const auto rows = static_cast<Eigen::Index>(table.lines.size());
  data.times.resize(rows);
  data.values.resize(rows, static_cast<Eigen::Index>(used.size()));
  for (Eigen::Index k = 0; k < rows; ++k) {
    const auto& row = table.lines[static_cast<std::size_t>(k)];
    data.times[k] = row[0];
    for (std::size_t c = 0; c < used.size(); ++c) data.values(k, static_cast<Eigen::Index>(c)) = row[used[c]];
  }
  return data;
}

std::string column_name(const FitData::Column& column, const CatalogueScene& entry) {
  if (column.output >= 0) return entry.outputs[static_cast<std::size_t>(column.output)].name;
  return (column.velocity ? "v_" : "") +
         entry.scene->coordinates[static_cast<std::size_t>(column.coordinate)];
}

std::string doubt_of_fit(const FitReport& report, const FitData& data, const Parameters& sigma) {
  constexpr double suspicious = 3.0;  // of the standard deviations given
  if (!report.converged || sigma.size() != data.columns.size() || !(report.residual > suspicious)) return {};
  return fmt::format(
      "what is left is {:.3g} times the deviations that --sigma states: another minimum, which --from may "
      "lead to, or another model",
      report.residual);
}

}  // namespace diracstep
