#include <algorithm>
#include <cmath>
#include <diracstep/c_interface/handles.hpp>
#include <diracstep/files/csv_table.hpp>
#include <diracstep/scene_format/fitted_scene.hpp>

using namespace diracstep;
using namespace diracstep::c_interface;

namespace {

CsvTable table_of(const diracstep_data& data) {
  constexpr std::size_t most_bytes = 100'000'000;
  if (data.file != nullptr) return read_csv(data.file, "the data", most_bytes, 2, EmptyFields::missing);
  CsvTable table;
  table.names = texts_of(data.columns, data.column, "the list of columns");
  table.names.insert(table.names.begin(), "t");
  if (data.rows < 1) throw Misuse("rows is " + std::to_string(data.rows) + "; 1 or more are needed");
  const double *time = &given(data.time, "the list of times"), *value = &given(data.value, "the values");
  for (long k = 0; k < data.rows; ++k) {
    std::vector<double>& line = table.lines.emplace_back(std::vector<double>{time[k]});
    line.insert(line.end(), value + k * data.columns, value + (k + 1) * data.columns);
  }
  return table;
}

/// The scene with the values that the search begins with.
FittedScene fitted(const diracstep_model& model, const diracstep_data& data) {
  FittedScene of{model.name, std::nullopt, model.changes,
                 texts_of(data.parameters, data.parameter, "the list of parameters")};
  if (!model.text.empty()) of.text = model.text;
  if (of.parameters.empty()) throw Misuse("no parameter is to be fitted; name one or more");
  for (const auto& [name, value] : named_values(data.starts, data.start, "start of the search")) {
    if (std::ranges::find(of.parameters, name) == of.parameters.end())
      throw Misuse("the start of the search: '" + name + "' is not among the parameters that are fitted");
    of.changes[name] = value;
  }
  return of;
}

void tell(const FitReport& report, diracstep_fitted& found) {
  found.motions = report.evaluations;
  found.measured = report.measured;
  found.residual = report.residual;
  found.value = keep_entries(report.parameters);
  found.interval = keep_entries(report.interval);
  found.covariance = keep_matrix(report.covariance);
  found.ending = keep(report.ending);
}

std::string in_turn(const std::string& first, const std::string& second) {
  return first.empty() || second.empty() ? first + second : first + "; " + second;
}

void fit_model(const diracstep_model& model, diracstep_options options, const diracstep_data& data,
               diracstep_fitted& found) {
  if (!entry_of(model).stated_start)
    throw Misuse("scene '" + model.entry.scene->name + "' is not from a file: its parameters are not fitted");
  if (steps_vary(options) || options.pushed != 0)
    throw Misuse("a fit takes steps of fixed size, and no push");
  if (data.confidence != 0.0 && !(data.confidence > 0.0 && data.confidence < 1.0))
    throw Misuse("confidence is " + to_text(data.confidence) + "; a number between 0 and 1 is needed");
  if (data.max_motions < 0)
    throw Misuse("max_motions is " + std::to_string(data.max_motions) + "; 1 or more is needed");
  const FittedScene of = fitted(model, data);
  const CatalogueScene& entry = model.entry;
  Vector begin = fit_start(of, entry);
  for (std::size_t k = 0; k < of.parameters.size(); ++k)
    if (const auto given_start = of.changes.find(of.parameters[k]); given_start != of.changes.end())
      begin[static_cast<Eigen::Index>(k)] = given_start->second;
  const Parameters sigma = named_values(data.sigmas, data.sigma, "sigma");
  const FitData measured = fit_data(
      table_of(data), data.file != nullptr ? "'" + std::string(data.file) + "'" : "the data", entry, sigma);
  options.ends = 1;  // for the direction of the step
  options.end = measured.times[measured.times.size() - 1];
  IntegratorOptions steps = stepping_from(model, options);
  steps.step = open_step(model, options, entry.scene->start.time);
  FitProblem problem = fit_problem(of, model.registry, solvers_from(options), steps);
  if (data.confidence != 0.0) problem.confidence = data.confidence;
  if (data.max_motions != 0) problem.max_evaluations = data.max_motions;
  problem.go_on = [stop = data.stop] { return !stopped(stop); };
  const std::string before = problem.scene(begin).doubt;
  const FitReport report = fit(problem, measured, begin);
  tell(report, found);
  found.doubt = keep(in_turn(before, doubt_of_fit(report, measured, sigma)));
  if (stopped(data.stop) && !report.converged) throw Interruption(report.ending);
  if (!report.converged) throw Failure("the fit has not converged: " + report.ending);
}

}  // namespace

int diracstep_fit(const diracstep_model* model, const diracstep_options* options, const diracstep_data* data,
                  diracstep_fitted* found) {
  return guarded([&] {
    diracstep_fitted& told = given(found, "where the findings go");
    told = {};
    told.ending = told.doubt = "";
    told.residual = std::nan("");
    fit_model(given(model, "the model"), options != nullptr ? *options : diracstep_options{},
              given(data, "the data"), told);
  });
}
