#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/core/adaptive/adaptive_run.hpp>
#include <diracstep/core/adaptive/damping_survey.hpp>
#include <diracstep/core/adaptive/error_control.hpp>
#include <diracstep/core/adaptive/error_with_events.hpp>
#include <diracstep/core/adaptive/variable_run_checks.hpp>
#include <diracstep/core/numerics/names.hpp>
#include <diracstep/core/runs/event_steps.hpp>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/core/spaces/space.hpp>
#include <diracstep/core/system/consistent_start.hpp>
#include <diracstep/scene_format/position_names.hpp>
#include <diracstep/sweeps/member_derivatives.hpp>
#include <diracstep/sweeps/member_run.hpp>
#include <limits>

namespace diracstep {

namespace {

constexpr long tried_for_an_example = 100, steps_between_looks = 1000;
constexpr double unknown_number = std::numeric_limits<double>::quiet_NaN();
constexpr const char* start_prefix = "start.";

/// A component of a start by its name, "x", "v_x" or "p_x".
struct Component {
  int coordinate = -1;
  char of = 'q';  ///< or 'v', 'p'
};

Component component(const Scene& scene, const std::string& name) {
  const auto find = [&](std::string_view coordinate) {
    const auto found = std::ranges::find(scene.coordinates, coordinate);
    return found == scene.coordinates.end() ? -1 : static_cast<int>(found - scene.coordinates.begin());
  };
  const int place = find(name);
  if (const auto stored = position_names(scene);
      scene.space && (place >= 0 || std::ranges::find(stored, name) != stored.end()))
    throw Misuse(
        fmt::format("'start.{}': a place on {} is no number; let formulas of its [start] depend on a "
                    "parameter, and vary that",
                    name, scene.space->name()));
  if (place >= 0) return {place, 'q'};
  if (name.starts_with("v_") || name.starts_with("p_"))
    if (const int i = find(std::string_view(name).substr(2)); i >= 0) return {i, name[0]};
  throw Misuse(fmt::format("'start.{}': the scene '{}' has no such coordinate{}", name, scene.name,
                           did_you_mean(name, scene.coordinates)));
}

void set_start(const Scene& scene, Start& start, const std::string& name, double value) {
  const Component at = component(scene, name);
  Vector& column = at.of == 'q' ? start.q : at.of == 'v' ? start.v : start.p;
  if (column.size() == 0)
    throw Misuse(fmt::format("start.{}: the scene '{}' starts with {}", name, scene.name,
                             at.of == 'v' ? "momenta: start.p_x" : "velocities: start.v_x"));
  column[at.coordinate] = value;
}

/// What may be moved onto the constraints: all where `project`, else what the scene's file calls a guess and
/// rates of states; never what the sweep gives.
std::optional<Guesses> guesses(const CatalogueScene& entry, bool project,
                               const std::vector<std::string>& given) {
  const auto n = static_cast<std::size_t>(entry.scene->dimension());
  Guesses movable{std::vector<bool>(n, project), std::vector<bool>(n, project)};
  const auto mark = [](std::vector<bool>& flags, const std::vector<StartOrigin>& origins) {
    for (std::size_t i = 0; i < origins.size(); ++i)
      if (origins[i] == StartOrigin::guess || origins[i] == StartOrigin::rate) flags[i] = true;
  };
  if (entry.stated_start) {
    mark(movable.q, entry.stated_start->q);
    mark(movable.v, entry.stated_start->v);
  }
  for (const std::string& name : given) {
    const Component at = component(*entry.scene, name);
    (at.of == 'q' ? movable.q : movable.v)[static_cast<std::size_t>(at.coordinate)] = false;
  }
  const auto none = [](const std::vector<bool>& flags) {
    return std::ranges::find(flags, true) == flags.end();
  };
  return none(movable.q) && none(movable.v) ? std::nullopt : std::optional(movable);
}

MemberResult result_of(const std::string& failure, const std::string& doubt, const CatalogueScene& entry,
                       const Sample& end, const Recorded& recorded) {
  if (!failure.empty()) return {MemberResult::Status::failed, failure, end.time, {}};
  return {doubt.empty() ? MemberResult::Status::ok : MemberResult::Status::doubted, doubt, end.time,
          recorded.numbers(entry, end)};
}

}  // namespace

MemberRuns::MemberRuns(const Sweep& sweep, SceneMaker make_scene, const Registry& registry,
                       SolverFactory solvers, std::function<bool()> goes_on)
    : sweep_(sweep),
      make_scene_(std::move(make_scene)),
      registry_(registry),
      solvers_(std::move(solvers)),
      goes_on_(std::move(goes_on)) {
  const long count = std::min(tried_for_an_example, sweep.members());
  for (long k = 0; !example_.scene; ++k) try {
      example_ = scene_of(k);
    } catch (const Misuse& misuse) {
      if (k + 1 < count) continue;
      throw Misuse(fmt::format("{}: no scene of the first {} members can be made: {}", sweep.file, count,
                               misuse.what()));
    }
  if (!sweep_.end) sweep_.end = example_.t_end;
  step_given_ = sweep_.step > 0.0;
  take_recommendation();
  if (sweep_.step == 0.0 && !sweep_.error) sweep_.step = example_.natural_step;
  sweep_.values = recorded_values(sweep, example_);
  const Recorded checked(sweep_, example_);
  const DerivativeNames checked_too(sweep_, example_);
  choose_method();
}

/// As a run does: the method and the step of the scene's file where the sweep names no method.
void MemberRuns::take_recommendation() {
  const Recommendation& advice = example_.recommended;
  if (!advice.stated || sweep_.error || sweep_.method != automatic_method || sweep_.order != 0) return;
  sweep_.method = advice.method;
  sweep_.order = advice.order;
  if (sweep_.step == 0.0) sweep_.step = advice.step;
}

/// Strong damping, where there is any, is looked for in the example alone: one method for all members.
void MemberRuns::choose_method() {
  options_.method = sweep_.method;
  options_.order = sweep_.order;
  if (sweep_.rule) options_.constraint_rule = registry_.rule(*sweep_.rule);
  if (sweep_.method != automatic_method || sweep_.error) return;
  const bool step_is_open = !step_given_;
  const double step = std::abs(sweep_.step);
  options_.step = std::copysign(step, *sweep_.end - example_.scene->start.time);
  const DefaultMethod chosen = default_method_of_motion(
      example_.scene, registry_, solvers_, *sweep_.end, step, options_,
      {options_.order, 0.0, options_.constraint_rule, large_from(options_.dense_limit)});
  options_.method = sweep_.method = chosen.method;
  options_.order = sweep_.order = chosen.order;
  if (step_is_open && example_.events.empty() && sweep_.derivatives.empty())
    local_error_ = chosen.local_error;
}

Parameters MemberRuns::parameters_of(long number) const {
  const std::vector<std::string> names = sweep_.names();
  const std::vector<double> values = sweep_.member(number);
  Parameters changes = sweep_.set;
  for (std::size_t k = 0; k < names.size(); ++k)
    if (!names[k].starts_with(start_prefix)) changes[names[k]] = values[k];
  return changes;
}

CatalogueScene MemberRuns::scene_of(long number) const {
  const std::vector<std::string> names = sweep_.names();
  const std::vector<double> values = sweep_.member(number);
  CatalogueScene entry = make_scene_(parameters_of(number));
  Start start = entry.scene->start;
  std::vector<std::string> given;
  for (std::size_t k = 0; k < names.size(); ++k) {
    if (!names[k].starts_with(start_prefix)) continue;
    given.push_back(names[k].substr(std::string_view(start_prefix).size()));
    set_start(*entry.scene, start, given.back(), values[k]);
  }
  if (given.empty() && !sweep_.project) return entry;
  if (const auto movable = guesses(entry, sweep_.project, given))
    start = project_start(*entry.scene, start, solvers_, *movable).start;
  auto scene = std::make_shared<Scene>(*entry.scene);
  scene->start = std::move(start);
  entry.scene = std::move(scene);
  return entry;
}

MemberResult MemberRuns::run(long number) const {
  MemberResult result;
  try {
    result = take(number);
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& exception) {
    result.status = MemberResult::Status::failed;
    result.reason = exception.what();
    result.time = unknown_number;
  }
  if (result.status == MemberResult::Status::failed)
    result.numbers.assign(recorded_names(sweep_).size(), unknown_number);
  return result;
}

MemberResult MemberRuns::take(long number) const {
  const CatalogueScene entry = scene_of(number);
  require_inputs_until(entry, *sweep_.end, "end");
  return sweep_.error ? search(entry) : take_steps(number, entry);
}

MemberResult MemberRuns::take_steps(long number, const CatalogueScene& entry) const {
  const double start = entry.scene->start.time;
  const StepGrid grid = fit_steps(start, *sweep_.end, std::copysign(sweep_.step, *sweep_.end - start));
  IntegratorOptions options = options_;
  options.step = grid.step;
  Recorded recorded(sweep_, entry);
  if (local_error_ > 0.0) return run_by_local_error(entry, options, recorded);
  if (!sweep_.derivatives.empty()) return run_with_derivatives(number, entry, options, grid.steps, recorded);
  return entry.events.empty() ? run_without_events(entry, options, grid.steps, recorded)
                              : run_through_events(entry, options, grid.steps, recorded);
}

MemberResult MemberRuns::run_without_events(const CatalogueScene& entry, const IntegratorOptions& options,
                                            long steps, Recorded& recorded) const {
  Integrator integrator(entry.scene, registry_, solvers_, options);
  std::optional<RunChecks> checks;
  if (sweep_.checks) checks.emplace(integrator, steps);
  Sample end;
  const auto see = [&](const Sample& node) {
    recorded.see(entry, node);
    end = node;
    return goes_on();
  };
  const RunReport report = run_steps(integrator, steps, Momentum::projected,
                                     recorded.needs_every_point() ? 1 : std::min(steps, steps_between_looks),
                                     see, checks ? &*checks : nullptr);
  if (!report.last.ok()) end.time = integrator.time();  // not every node was seen
  return result_of(report.last.failure, checks ? checks->text() : "", entry, end, recorded);
}

MemberResult MemberRuns::run_with_derivatives(long number, const CatalogueScene& entry,
                                              const IntegratorOptions& options, long steps,
                                              Recorded& recorded) const {
  Integrator integrator(entry.scene, registry_, solvers_, options);
  MemberDerivatives derivatives(sweep_, entry, parameters_of(number), registry_, integrator);
  std::optional<RunChecks> checks;
  if (sweep_.checks) checks.emplace(integrator, steps);
  Sample end;
  std::vector<double> numbers;
  long seen = 0;  // the start is seen first
  const RunReport report = run_steps(
      integrator, steps, Momentum::projected, 1,
      [&](const Sample& node) {
        if (seen > 0) derivatives.follow_step();
        recorded.see(entry, node);
        end = node;
        if (seen++ == steps) numbers = derivatives.numbers();  // before the checks take further steps
        return goes_on();
      },
      checks ? &*checks : nullptr);
  const std::string doubt = joined_doubts({checks ? checks->text() : "", derivatives.doubt()});
  MemberResult result = result_of(report.last.failure, doubt, entry, end, recorded);
  if (result.status != MemberResult::Status::failed)
    result.numbers.insert(result.numbers.end(), numbers.begin(), numbers.end());
  return result;
}

MemberResult MemberRuns::run_by_local_error(const CatalogueScene& entry, const IntegratorOptions& options,
                                            Recorded& recorded) const {
  AdaptiveIntegrator integrator(entry.scene, registry_, solvers_, options,
                                {.eps = local_error_, .end = *sweep_.end});
  std::optional<VariableRunChecks> checks;
  if (sweep_.checks)
    checks.emplace(integrator, Integrator(entry.scene, registry_, solvers_, integrator.options()));
  Sample end;
  const auto see = [&](const Sample& node) {
    recorded.see(entry, node);
    end = node;
    return goes_on();
  };
  const RunReport report =
      run_until(integrator, *sweep_.end, Momentum::projected, 1, see, checks ? &*checks : nullptr);
  return result_of(report.last.failure, checks ? checks->text() : "", entry, end, recorded);
}

/// Without the checks of a run: those of steps between events say little of the whole.
MemberResult MemberRuns::run_through_events(const CatalogueScene& entry, const IntegratorOptions& options,
                                            long steps, Recorded& recorded) const {
  EventSteps<Integrator> motion(entry.scene, entry.all_rows, entry.events, solvers_, Momentum::projected,
                                integrators(registry_, solvers_, options));
  Sample end;
  SolveReport read = motion.sample(end);
  std::string failure;
  for (long k = 0; k < steps && read.ok() && failure.empty() && !motion.stopped() && goes_on(); ++k) {
    recorded.see(entry, end);
    failure = motion.step().failure;
    if (failure.empty() && !motion.stopped()) read = motion.sample(end);
  }
  if (failure.empty() && !read.ok()) failure = std::string("reading a point: ") + describe(read.status);
  for (const EventHit& hit : motion.hits()) {
    recorded.see(entry, hit.sample);
    recorded.see_event(entry.events[hit.event].name, hit.sample.time);
  }
  if (motion.stopped()) end = motion.end_of_stopped();
  recorded.see(entry, end);
  return result_of(failure, "", entry, end, recorded);
}

/// The run that is accepted is taken once more where each of its points is wanted, or the events on its way.
MemberResult MemberRuns::search(const CatalogueScene& entry) const {
  ErrorControlOptions wanted;
  wanted.error = *sweep_.error;
  wanted.method = sweep_.method;
  wanted.order = sweep_.order;
  wanted.integrator = options_;
  wanted.max_time =
      std::numeric_limits<double>::infinity();  // solves alone, so that the answer is the same anywhere
  wanted.go_on = goes_on_;
  const double end = *sweep_.end;
  const bool through_events = !entry.events.empty();
  if (through_events) wanted.first_step = std::abs(entry.natural_step);
  const ErrorControlReport found =
      through_events
          ? solve_events_to_error(entry.scene, entry.all_rows, entry.events, registry_, solvers_, end, wanted)
          : solve_to_error(entry.scene, registry_, solvers_, end, wanted);
  if (!found.ok())  // no answer, though runs may have come some way
    return {MemberResult::Status::failed, found.refusal, unknown_number, {}};
  Recorded recorded(sweep_, entry);
  if (through_events) {
    IntegratorOptions options = found.steps.integrator;
    options.method = found.method;
    options.order = found.order;
    options.step = found.step;
    return run_through_events(entry, options, fit_steps(entry.scene->start.time, end, found.step).steps,
                              recorded);
  }
  if (recorded.needs_every_point()) {
    const auto see = [&](const Sample& node) {
      recorded.see(entry, node);
      return goes_on();
    };
    const RunReport again = run_again(entry.scene, registry_, solvers_, found, Momentum::projected, 1, see);
    if (!again.ok()) return {MemberResult::Status::failed, again.last.failure, unknown_number, {}};
  }
  return {found.warning.empty() ? MemberResult::Status::ok : MemberResult::Status::doubted, found.warning,
          found.end.time, recorded.numbers(entry, found.end)};
}

}  // namespace diracstep
