#include <fmt/format.h>

#include <CLI/App.hpp>
#include <algorithm>
#include <cmath>
#include <diracstep/command/arguments.hpp>
#include <diracstep/command/interrupt.hpp>
#include <diracstep/command/verbs.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/files/output_file.hpp>
#include <diracstep/reports/json.hpp>
#include <diracstep/reports/plot.hpp>
#include <diracstep/reports/report.hpp>
#include <diracstep/scene_format/fitted_scene.hpp>
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
  std::vector<NamedPath> inputs = inputs_of({arguments.scene}, session), outputs;
  inputs.push_back({"the data", arguments.data});
  if (!arguments.residuals.empty()) outputs.push_back({"--residuals", arguments.residuals});
  if (!arguments.picture.empty())
    for (const std::string& file : picture_files(arguments.picture)) outputs.push_back({"--picture", file});
  require_outputs(outputs, inputs);
  const CatalogueScene entry = make_scene(session, arguments.scene, changes);
  const FittedScene of{arguments.scene, std::nullopt, changes, parameters_fitted};
  const Vector begin = fit_start(of, entry);
  const Parameters sigma = parameters(arguments.sigma, "--sigma");
  const FitData data =
      fit_data(read_csv(arguments.data, "the data", most_data_bytes, 2, EmptyFields::missing),
               fmt::format("'{}'", arguments.data), entry, sigma);
  take_recommendation(entry, arguments.method, arguments.step);
  IntegratorOptions steps = integrator_options(session, arguments.method);
  const double last = data.times[data.times.size() - 1];
  steps.step = arguments.step.value_or(entry.natural_step);
  if (!arguments.step) steps.step = std::copysign(steps.step, last - entry.scene->start.time);
  FitProblem problem = fit_problem(of, session.registry, session.solvers, steps);
  problem.max_evaluations = arguments.max_evaluations;
  problem.confidence = arguments.confidence;
  problem.go_on = [] { return !interrupted(); };
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
  if (const std::string doubt = doubt_of_fit(report, data, sigma); !doubt.empty()) {
    say("doubted: " + doubt);
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
