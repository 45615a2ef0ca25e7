#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/command/arguments.hpp>
#include <diracstep/command/interrupt.hpp>
#include <diracstep/command/verbs.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/numerics/near_names.hpp>
#include <diracstep/files/csv_table.hpp>
#include <diracstep/files/output_file.hpp>
#include <diracstep/reports/json.hpp>
#include <diracstep/reports/plot.hpp>
#include <diracstep/reports/report.hpp>
#include <diracstep/scene_format/parametric_scene_file.hpp>
#include <diracstep/scene_format/position_names.hpp>
#include <diracstep/sensitivities/fit.hpp>
#include <memory>

namespace diracstep::command {

namespace {

constexpr std::size_t most_data_bytes = 100'000'000;

struct FitArguments {
  std::string scene, data, parameters, residuals, picture;
  MethodChoice method;
  std::optional<double> step;
  std::vector<std::string> set, from, sigma;
  double confidence = 0.95;
  int max_evaluations = 200;
  bool json = false;
};

/// Columns of a trajectory that nothing is fitted to.
bool is_left_alone(const std::string& name) {
  return name == "energy" || std::ranges::any_of(std::array{"p_", "lambda_", "invariant_", "d("},
                                                 [&](const char* start) { return name.starts_with(start); });
}

/// The columns that are coordinates, velocities v_NAME or outputs; any other name is a mistake.
FitData data_of(const CsvTable& table, const std::string& path, const CatalogueScene& entry,
                const Parameters& sigma) {
  const Scene& scene = *entry.scene;
  if (table.lines.empty()) throw Misuse(fmt::format("'{}' has no lines of data", path));
  if (table.names.empty()) throw Misuse(fmt::format("'{}': the first line does not name the columns", path));
  if (table.names.front() != "t")
    throw Misuse(fmt::format("'{}': the first column is '{}'; expected t", path, table.names.front()));
  std::vector<std::string> known;
  for (const char* prefix : {"", "v_"})
    for (const std::string& name : scene.coordinates) known.push_back(prefix + name);
  for (const Output& output : entry.outputs) known.push_back(output.name);
  FitData data;
  std::vector<std::size_t> used;
  Parameters left = sigma;
  for (std::size_t c = 1; c < table.names.size(); ++c) {
    const std::string& name = table.names[c];
    const auto found = std::ranges::find(known, name);
    if (found == known.end()) {
      if (is_left_alone(name)) continue;
      throw Misuse(fmt::format("'{}': the column '{}' is no coordinate, velocity or output of scene '{}'{}",
                               path, name, scene.name, did_you_mean(name, known)));
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
    throw Misuse(fmt::format("'{}' has no column of a coordinate, velocity or output of scene '{}'", path,
                             scene.name));
  if (!left.empty())
    throw Misuse(fmt::format("--sigma: '{}' is no column of '{}'", left.begin()->first, path));
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

std::string fit_text(const FitReport& report, const std::vector<std::string>& names,
                     const FitArguments& arguments, const std::string& scene) {
  std::string text = fmt::format("{}: {} parameters from {} measured numbers, {} motions; {}\n\n", scene,
                                 names.size(), report.measured, report.evaluations, report.ending);
  std::vector<std::vector<std::string>> rows{
      {"", "value", fmt::format("+- ({:g} %)", 100.0 * arguments.confidence), "standard error"}};
  for (std::size_t k = 0; k < names.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    rows.push_back({names[k], fmt::format("{:.10g}", report.parameters[i]),
                    fmt::format("{:.3g}", report.interval[i]),
                    fmt::format("{:.3g}", std::sqrt(report.covariance(i, i)))});
  }
  text += aligned(rows);
  if (names.size() > 1 && report.interval.allFinite()) {
    std::vector<std::vector<std::string>> table{{"correlation"}};
    table[0].insert(table[0].end(), names.begin(), names.end());
    for (std::size_t i = 0; i < names.size(); ++i) {
      auto& row = table.emplace_back(std::vector<std::string>{names[i]});
      for (std::size_t j = 0; j < names.size(); ++j) {
        const auto a = static_cast<Eigen::Index>(i), b = static_cast<Eigen::Index>(j);
        row.push_back(fmt::format("{:.3f}", report.covariance(a, b) / std::sqrt(report.covariance(a, a) *
                                                                                report.covariance(b, b))));
      }
    }
    text += '\n' + aligned(table);
  }
  std::string open;
  for (std::size_t k = 0; k < names.size(); ++k)
    if (!std::isfinite(report.interval[static_cast<Eigen::Index>(k)]))
      open += (open.empty() ? "" : ", ") + names[k];
  if (!open.empty() && std::isfinite(report.residual))
    text += fmt::format("the data do not determine {}: intervals are infinite\n", open);
  return text +
         fmt::format("\nstandard deviation of what is left: {:.6g} (units of sigma)\n", report.residual);
}

std::string fit_json(const FitReport& report, const std::vector<std::string>& names,
                     const FitArguments& arguments, const std::string& scene) {
  Json json{{"scene", scene},
            {"converged", report.converged},
            {"ending", report.ending},
            {"confidence", arguments.confidence},
            {"measured", report.measured},
            {"motions", report.evaluations},
            {"residual", Json(report.residual)},
            {"parameters", Json::object()},
            {"covariance", Json::array()}};
  for (std::size_t k = 0; k < names.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    add_member(json["parameters"], names[k],
               Json{{"value", Json(report.parameters[i])}, {"interval", Json(report.interval[i])}});
    Json row = Json::array();
    for (Eigen::Index j = 0; j < report.covariance.cols(); ++j) row.push_back(Json(report.covariance(i, j)));
    json["covariance"].push_back(std::move(row));
  }
  return to_text(json, 2) + '\n';
}

std::string column_name(const FitData::Column& column, const CatalogueScene& entry) {
  if (column.output >= 0) return entry.outputs[static_cast<std::size_t>(column.output)].name;
  return (column.velocity ? "v_" : "") +
         entry.scene->coordinates[static_cast<std::size_t>(column.coordinate)];
}

/// What is left of each column in units of its standard deviation, over the time.
void draw_residuals(const std::string& stem, const FitData& data, const FitReport& report,
                    const CatalogueScene& entry) {
  std::string script = "set xlabel 't'\nset ylabel '(measured - motion)/sigma'\nset grid\nset key outside\n";
  std::string curves;
  for (std::size_t c = 0; c < data.columns.size(); ++c) {
    script += fmt::format("$data{} << EOD\n", c);
    for (Eigen::Index k = 0; k < data.times.size(); ++k)
      if (const double left = report.residuals(k, static_cast<Eigen::Index>(c)); std::isfinite(left))
        script += fmt::format("{:.17g} {:.17g}\n", data.times[k], left);
    script += "EOD\n";
    curves += fmt::format(", $data{} using 1:2 with points title {}", c,
                          gnuplot_text(column_name(data.columns[c], entry)));
  }
  const double band = student_quantile(0.95, 1e6) * report.residual;  // of 95 in 100
  script += fmt::format(
      "band = {:.17g}\nplot band with lines dashtype 2 linecolor 'grey' title '95 %', "
      "-band with lines dashtype 2 linecolor 'grey' notitle{}\n",
      band, curves);
  if (const std::string failure = render(script, stem, 800, 400); !failure.empty())
    throw Error("--picture: " + failure);
}

void write_residuals(const std::string& path, const FitData& data, const FitReport& report,
                     const CatalogueScene& entry) {
  std::string text = "t";
  for (const FitData::Column& column : data.columns) text += "," + csv_field(column_name(column, entry));
  text += '\n';
  for (Eigen::Index k = 0; k < data.times.size(); ++k) {
    text += fmt::format("{:.17g}", data.times[k]);
    for (Eigen::Index c = 0; c < report.residuals.cols(); ++c)
      text += std::isnan(report.residuals(k, c)) ? std::string(",")
                                                 : fmt::format(",{:.17g}", report.residuals(k, c));
    text += '\n';
  }
  OutputFile file(path, OutputFile::Mode::fresh);
  file.write(text);
  file.close();
}

void run_fit(FitArguments arguments, Session& session) {
  if (!(arguments.confidence > 0.0 && arguments.confidence < 1.0))
    throw Misuse(
        fmt::format("--confidence = {:g}; a number between 0 and 1 is needed", arguments.confidence));
  if (arguments.max_evaluations < 1)
    throw Misuse(fmt::format("--max-motions = {}; 1 or more is needed", arguments.max_evaluations));
  const std::vector<std::string> parameters_fitted = names("--parameters", arguments.parameters);
  Parameters changes = parameters(arguments.set);
  for (const auto& [name, value] : parameters(arguments.from, "--from")) {
    if (std::ranges::find(parameters_fitted, name) == parameters_fitted.end())
      throw Misuse(
          fmt::format("--from: '{}' is not among the parameters that are fitted; --set fixes others", name));
    changes[name] = value;
  }
  const CatalogueScene entry = make_scene(session, arguments.scene, changes);
  require_flat(*entry.scene, "fit");
  if (!entry.events.empty())
    throw Misuse("fit does not go with the events of the scene: when one is met is not differentiated");
  Vector begin(static_cast<Eigen::Index>(parameters_fitted.size()));
  for (std::size_t k = 0; k < parameters_fitted.size(); ++k) {
    const auto found = entry.parameters.find(parameters_fitted[k]);
    if (found == entry.parameters.end())
      throw Misuse(fmt::format("--parameters: scene '{}' has no parameter '{}'", entry.scene->name,
                               parameters_fitted[k]));
    begin[static_cast<Eigen::Index>(k)] = found->second;
  }
  const CsvTable table = read_csv(arguments.data, "the data", most_data_bytes, 2, EmptyFields::missing);
  const FitData data = data_of(table, arguments.data, entry, parameters(arguments.sigma, "--sigma"));
  take_recommendation(entry, arguments.method, arguments.step);
  IntegratorOptions steps = integrator_options(session, arguments.method);
  const double last = data.times[data.times.size() - 1];
  steps.step = arguments.step.value_or(entry.natural_step);
  if (!arguments.step) steps.step = std::copysign(steps.step, last - entry.scene->start.time);
  const auto all_of = [&](const Vector& values) {
    Parameters all = changes;
    for (std::size_t k = 0; k < parameters_fitted.size(); ++k)
      all[parameters_fitted[k]] = values[static_cast<Eigen::Index>(k)];
    return all;
  };
  const FitProblem problem{
      [&](const Vector& values) {
        const Parameters all = all_of(values);
        return parametric_scene(arguments.scene, diracstep::make_scene(arguments.scene, all),
                                parameters_fitted, all);
      },
      session.registry,
      session.solvers,
      steps,
      arguments.max_evaluations,
      arguments.confidence,
      [&](const Vector& values) {
        std::vector<PointFunction> functions;
        for (Output& output : diracstep::make_scene(arguments.scene, all_of(values)).outputs)
          functions.push_back(std::move(output.at));
        return functions;
      },
      [] { return !interrupted(); }};
  if (const std::string doubt = problem.scene(begin).doubt; !doubt.empty()) {
    say(doubt);
    session.exit_status = doubted;
  }
  catch_interrupts();
  const FitReport report = fit(problem, data, begin);
  if (!arguments.residuals.empty()) write_residuals(arguments.residuals, data, report, entry);
  if (!arguments.picture.empty()) draw_residuals(arguments.picture, data, report, entry);
  print(arguments.json ? fit_json(report, parameters_fitted, arguments, entry.scene->name)
                       : fit_text(report, parameters_fitted, arguments, entry.scene->name));
  constexpr double suspicious = 3.0;  // of the standard deviations given
  const bool all_given = parameters(arguments.sigma, "--sigma").size() == data.columns.size();
  if (report.converged && all_given && report.residual > suspicious) {
    say(fmt::format(
        "doubted: what is left is {:.3g} times the deviations that --sigma states: another minimum, "
        "which --from may lead to, or another model",
        report.residual));
    session.exit_status = doubted;
  }
  if (report.converged) return;
  say(fmt::format("the fit has not converged: {}", report.ending));
  session.exit_status = failed;
}

}  // namespace

void add_fit(CLI::App& app, Session& session) {
  CLI::App* verb = app.add_subcommand("fit", "Parameters of a scene from measured data");
  const auto arguments = std::make_shared<FitArguments>();
  add_solver_options(*verb, session);
  verb->add_option("SCENE", arguments->scene, "A scene; see diracstep list scenes")->required();
  verb->add_option("DATA", arguments->data,
                   "CSV: t, then coordinates, velocities v_NAME and outputs; fields may be empty")
      ->required();
  verb->add_option("--parameters", arguments->parameters, "Parameters of the scene to be fitted")
      ->type_name("P1,P2,…")
      ->required();
  verb->add_option("--from", arguments->from, "Where the search begins; without, the values of the scene")
      ->type_name("NAME=VALUE");
  verb->add_option("--sigma", arguments->sigma,
                   "Standard deviation of a column, or that in relation to the others; 1 without")
      ->type_name("NAME=VALUE");
  verb->add_option("--confidence", arguments->confidence, "Of the intervals")->capture_default_str();
  verb->add_option("--max-motions", arguments->max_evaluations, "Motions that the search may take")
      ->capture_default_str();
  verb->add_option("--residuals", arguments->residuals, "CSV file for what is left of the data")
      ->type_name("FILE");
  verb->add_option("--picture", arguments->picture, "STEM.svg and STEM.png of the same over the time")
      ->type_name("STEM");
  add_method_options(*verb, arguments->method);
  verb->add_option(
      "--step", arguments->step,
      "Largest step; between two times so many equal ones are taken. The scene's own without it");
  add_set_option(*verb, arguments->set);
  verb->add_flag("--json", arguments->json, "One JSON document on standard output");
  verb->footer(
      "Examples:\n"
      "  diracstep fit chaplygin_sleigh measured.csv --parameters m,a,J\n"
      "  diracstep fit pendulum.toml swing.csv --parameters g --from g=9 --sigma angle=0.01 --json");
  verb->callback([arguments, &session] { run_fit(*arguments, session); });
}

}  // namespace diracstep::command
