#include <cmath>
#include <diracstep/c_interface/point_writer.hpp>
#include <diracstep/core/adaptive/error_control.hpp>
#include <diracstep/core/adaptive/error_with_events.hpp>
#include <diracstep/core/adaptive/rate_monitor.hpp>
#include <diracstep/core/runs/run_points.hpp>
#include <utility>

using namespace diracstep;
using namespace diracstep::c_interface;

namespace {

std::optional<bool> varies(int steps) {
  if (steps < 0 || steps > 2)
    throw Misuse("steps of the search is " + std::to_string(steps) +
                 "; 0 (chosen), 1 (fixed), 2 (they vary)");
  return steps == 0 ? std::nullopt : std::optional<bool>(steps == 2);
}

ErrorControlOptions wanted(const diracstep_model& model, const diracstep_options& options,
                           const diracstep_course& course, const diracstep_error& error) {
  ErrorControlOptions search;
  search.error = error.error;
  if (options.method != nullptr) search.method = options.method;
  search.order = options.order;
  search.adaptive = varies(error.steps);
  search.control = control_from(options);
  if (options.step != 0.0)
    search.first_step = std::abs(options.step);
  else if (!model.entry.events.empty() || !has_accelerations(*model.scene))
    search.first_step = std::abs(model.entry.natural_step);
  search.integrator = stepping_from(model, options);
  search.integrator.method = automatic_method;
  search.integrator.order = options.order;
  search.integrator.step = options.step != 0.0 ? options.step : model.entry.natural_step;
  if (error.max_solves != 0) search.max_solves = error.max_solves;
  if (error.max_time != 0.0) search.max_time = error.max_time;
  search.go_on = [stop = course.stop] { return !stopped(stop); };
  return search;
}

std::vector<std::string> cells_of(const std::vector<ErrorControlRun>& runs) {
  std::vector<std::string> cells;
  for (const ErrorControlRun& run : runs)
    cells.insert(cells.end(),
                 {to_text(run.step, 17), std::to_string(run.steps), std::to_string(run.solves),
                  to_text(run.difference), to_text(run.estimate), to_text(run.observed_order), run.failure});
  return cells;
}

std::string joined(const std::string& first, const std::string& second, const std::string& third) {
  std::string all;
  for (const std::string& text : {first, second, third})
    if (!text.empty()) all += (all.empty() ? "" : "; ") + text;
  return all;
}

diracstep_found found_from(const ErrorControlReport& report) {
  return {report.estimate,
          report.observed_order,
          report.step,
          report.order,
          report.adaptive ? 1 : 0,
          report.work.solves,
          keep(report.method),
          keep(joined(report.method_reason, report.reason, report.division)),
          keep(report.warning),
          keep(7, cells_of(report.runs)),
          0,
          0,
          nullptr};
}

/// Throws what the search ended with where it was refused; its best answer is then the only point.
void require_found(const ErrorControlReport& report, const CatalogueScene& entry,
                   const diracstep_course& course, diracstep_points& points) {
  if (report.ok()) return;
  PointWriter writer(points, entry);
  if (report.end.q.size() > 0) writer.write(report.end);
  if (stopped(course.stop)) throw Interruption(report.refusal);
  throw Failure(report.refusal);
}

/// The run that a search through events has accepted, once more: each of its points, with the checks of a
/// run.
void take_found_steps(const diracstep_model& model, diracstep_options options,
                      const ErrorControlReport& report, diracstep_course course, diracstep_points& points,
                      diracstep_found& found) {
  options.method = report.method.c_str();
  options.order = report.order;
  options.step = report.step;
  options.ends = course.ends = 1;
  options.end = course.end;
  options.eps = 0.0;
  course.steps = 0;
  const std::shared_ptr<diracstep_integrator> handle = make_integrator(model, options);
  const auto events = std::make_shared<std::vector<diracstep_event>>();
  keep(handle);
  keep(events);
  run_course(*handle, course, points);
  *events = events_of(*handle);
  found.stopped = handle->event_at_end() != nullptr ? 1 : 0;
  found.events = static_cast<long>(events->size());
  found.event = events->data();
  if (!handle->doubt.empty()) found.warning = keep(joined(report.warning, handle->doubt, ""));
}

/// Finds the steps through the events of the scene, and takes them.
void solve_through_events(const diracstep_model& model, const diracstep_options& options,
                          const diracstep_course& course, const diracstep_error& error,
                          diracstep_points& points, diracstep_found& found) {
  const CatalogueScene& entry = entry_of(model);
  if (error.steps == 2)
    throw Misuse("an error asked for takes steps of fixed size through the events of the scene");
  const ErrorControlReport report =
      solve_events_to_error(entry.scene, entry.all_rows, entry.events, model.registry, solvers_from(options),
                            course.end, wanted(model, options, course, error));
  found = found_from(report);
  require_found(report, entry, course, points);
  take_found_steps(model, options, report, course, points, found);
}

/// Throws Misuse for times out of order or behind the end.
void require_times(const diracstep_course& course, double start, double end) {
  double last = start;
  for (int k = 0; k < course.times; ++k)
    detail::require_ahead(std::exchange(last, course.time[k]), course.time[k], end - start);
  detail::require_ahead(last, end, end - start);
}

void solve(const diracstep_model& model, const diracstep_options& options, diracstep_course course,
           const diracstep_error& error, diracstep_points& points, diracstep_found& found) {
  require_sense(course);
  const CatalogueScene& entry = entry_of(model);
  if (course.ends == 0) course.end = end_from(model, options);
  const double end = course.end;
  require_inputs_until(entry, end, "the end");
  require_times(course, entry.scene->start.time, end);
  points.count = 0;
  if (!entry.events.empty()) return solve_through_events(model, options, course, error, points, found);
  const SolverFactory solvers = solvers_from(options);
  const ErrorControlReport report =
      solve_to_error(entry.scene, model.registry, solvers, end, wanted(model, options, course, error));
  found = found_from(report);
  require_found(report, entry, course, points);
  PointWriter writer(points, entry);
  const auto write = [&](const Sample& point) {
    writer.write(point);
    return !stopped(course.stop);
  };
  const Momentum momentum = momentum_from(course.momentum);
  const RunReport again = course.times > 0
                              ? run_again_at(entry.scene, model.registry, solvers, report, momentum,
                                             {course.time, course.time + course.times}, write)
                              : run_again(entry.scene, model.registry, solvers, report, momentum,
                                          course.every > 0 ? course.every : 1, write);
  if (!again.ok()) throw Failure(again.last.failure);
  if (stopped(course.stop) && !writer.has(report.end.time))
    throw Interruption("interrupted on the way to t = " + to_text(end, 17));
}

}  // namespace

int diracstep_solve(const diracstep_model* model, const diracstep_options* options,
                    const diracstep_course* course, const diracstep_error* error, diracstep_points* points,
                    diracstep_found* found) {
  return guarded([&] {
    diracstep_found& told = given(found, "where the findings go");
    told = {};
    told.method = told.reason = told.warning = "";
    solve(given(model, "the model"), options != nullptr ? *options : diracstep_options{},
          course != nullptr ? *course : diracstep_course{}, given(error, "the error"),
          given(points, "where the points go"), told);
  });
}
