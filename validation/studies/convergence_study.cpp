#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/core/methods/composition.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/plugins/callback_error.hpp>
#include <diracstep/validation/studies/convergence_study.hpp>
#include <diracstep/validation/studies/formulation_choice.hpp>
#include <diracstep/validation/studies/work_precision.hpp>
#include <utility>

namespace diracstep {

namespace {

constexpr double coarse_error = 1e-2;     // a ladder begins at a step with at least this error
constexpr double plateau_ceiling = 1e-6;  // errors above it are never taken for round-off
constexpr double still_falling = 0.7;     // an order-1 method halves the error where the step is halved
constexpr int plateau_length = 2;         // refinements in vain that end a ladder
constexpr double usual_ladder = 12.0;     // rows, for the progress only
constexpr std::size_t longest_ladder = 40;
constexpr double fewest_steps = 2.0;
constexpr double natural_eps = 1.0;       // radians of the coarsest variable step
constexpr double smallest_error = 1e-17;  // an error of zero has no logarithm

struct Interrupted {};

class StudyInProgress {
 public:
  StudyInProgress(const CatalogueScene& scene, const Registry& registry, const SolverFactory& solvers,
                  const StudyOptions& options, const StudyObserver& observer)
      : entry_(scene), registry_(registry), solvers_(solvers), options_(options), observer_(observer) {
    entry_.scene = completed(scene.scene);
    study_.scene = entry_.scene->name;
    study_.parameters = scene.parameters;
    study_.t_start = entry_.scene->start.time;
    study_.t_end = options.t_end.value_or(scene.t_end);
    study_.unknowns = entry_.scene->dimension() + entry_.scene->rows();
    study_.momentum = options.momentum;
    natural_step_ = std::copysign(scene.natural_step, study_.t_end - study_.t_start);
    require_options();
    for (const auto& method : options_.methods)
      for (const int order : orders_of(method)) {
        series_.push_back(chosen(method, order));
        if (options.adaptive) series_.push_back(series_.back().with_variable_steps());
      }
    require_one_that_fits();
  }

  Study run() {
    try {
      look(0.0, "reference");
      reference_ = reference_end(entry_, study_.t_end);
      study_.reference_kind = reference_.kind;
      study_.reference_how = reference_.how;
      study_.reference_error = reference_.self_error;
      for (; series_done_ < series_.size(); ++series_done_) run_series(series_[series_done_]);
      for (std::size_t i = 0; i < options_.baselines.size(); ++i)
        run_baseline_ladder(options_.baselines[i],
                            static_cast<double>(i) / static_cast<double>(options_.baselines.size()));
    } catch (const Interrupted&) {
      study_.interrupted = true;
    }
    conclude(study_);
    return std::move(study_);
  }

 private:
  struct Series {
    std::string method;
    int order;
    bool variable;

    std::string name() const { return method + (variable ? variable_steps : ""); }
    Series with_variable_steps() const { return {method, order, true}; }
  };

  void require_options() const {
    if (options_.methods.empty()) throw Misuse("a study needs at least one method");
    if (options_.repeats < 1) throw Misuse(fmt::format("repeat = {}; 1 or more is needed", options_.repeats));
    if (!(options_.run_budget > 0.0))
      throw Misuse(fmt::format("the budget of a run is {} s; a time above 0 is needed", options_.run_budget));
    for (const double rtol : options_.rtols)
      if (!(rtol >= 1e-14 && rtol <= 1e-1))
        throw Misuse(fmt::format("rtol = {}; it must lie in [1e-14, 1e-1]", rtol));
    if (!std::isfinite(study_.t_end) || study_.t_end == study_.t_start)
      throw Misuse(fmt::format("the end time is {}; a finite time other than the start, {}, is needed",
                               study_.t_end, study_.t_start));
    for (const double step : options_.steps) (void)fit_steps(study_.t_start, study_.t_end, step);
  }

  Series chosen(const std::string& method, int order) const {
    if (method != automatic_method) return {method, order, false};
    const DefaultMethod choice =
        default_method(*completed(entry_.scene), {.order = order, .rule = options_.constraint_rule});
    return {choice.method, choice.order, false};
  }

  std::vector<int> orders_of(const std::string& method) const {
    if (method == automatic_method) return options_.orders.empty() ? std::vector<int>{0} : options_.orders;
    const Method known = registry_.method(method);
    return options_.orders.empty() ? possible_orders(known.info) : options_.orders;
  }

  /// A method or order that fits nothing is a mistake; one of several that does not fit becomes a row.
  void require_one_that_fits() const {
    std::string reason;
    for (const Series& series : series_) {
      try {
        (void)integrator(series, natural_step_);
        return;
      } catch (const Misuse& misuse) {
        if (reason.empty()) reason = misuse.what();
      }
    }
    throw Misuse(reason);
  }

  IntegratorOptions integrator_options(const Series& series, double step) const {
    return {series.method, series.order, step, options_.constraint_rule};
  }

  Integrator integrator(const Series& series, double step) const {
    return {entry_.scene, registry_, solvers_, integrator_options(series, step)};
  }

  void look(double part_of_series, const std::string& what) const {
    if (!observer_) return;
    const double all = static_cast<double>(series_.size() + (options_.rtols.empty() ? 0 : 1));
    if (!observer_((static_cast<double>(series_done_) + part_of_series) / all, study_.scene + ": " + what))
      throw Interrupted{};
  }

  const StudyRow& run_row(const Series& series, double step, double part) {
    if (series.variable) return run_variable_row(series, step, part);
    const StepGrid grid = fit_steps(study_.t_start, study_.t_end, step);
    const std::string what = fmt::format("{} order {}, step {:.3g}", series.method, series.order, grid.step);
    const auto look_around = [&] { look(part, what); };
    look_around();
    Integrator ours = integrator(series, grid.step);
    return study_.rows.emplace_back(
        run_ours(ours, grid.steps, options_.momentum, options_.repeats, reference_, look_around));
  }

  const StudyRow& run_variable_row(const Series& series, double eps, double part) {
    const std::string what = fmt::format("{} order {}, eps {:.3g}", series.name(), series.order, eps);
    const auto look_around = [&] { look(part, what); };
    look_around();
    AdaptiveIntegrator ours(entry_.scene, registry_, solvers_, integrator_options(series, natural_step_),
                            {.eps = eps, .end = study_.t_end});
    return study_.rows.emplace_back(
        run_variable(ours, study_.t_end, options_.momentum, options_.repeats, reference_, look_around));
  }

  void run_series(const Series& series) {
    const std::size_t first = study_.rows.size();
    study_.measured_orders.push_back({series.name(), series.order, {}, 0, {}});
    try {
      if (options_.steps.empty() || series.variable)
        study_.measured_orders.back().ladder_end = climb(series);
      else
        for (std::size_t i = 0; i < options_.steps.size(); ++i)
          run_row(series, options_.steps[i],
                  static_cast<double>(i) / static_cast<double>(options_.steps.size()));
    } catch (const Misuse& misuse) {
      study_.rows.push_back({.method = series.name(), .order = series.order, .status = misuse.what()});
    } catch (const CallbackError& error) {
      study_.rows.push_back({.method = series.name(), .order = series.order, .status = error.what()});
    }
    std::stable_sort(
        study_.rows.begin() + static_cast<std::ptrdiff_t>(first), study_.rows.end(),
        [](const StudyRow& a, const StudyRow& b) { return std::abs(a.step) > std::abs(b.step); });
  }

  /// Runs the ladder of one series and says why it ended.
  std::string climb(const Series& series) {
    const double factor = series.order > 4 ? std::sqrt(2.0) : 2.0;
    const std::size_t first = study_.rows.size();
    const double start = series.variable ? natural_eps : natural_step_;
    const StudyRow natural = run_row(series, start, 0.0);
    if (!series.variable) coarsen(series, factor, natural.error());
    double cpu_seconds = natural.cpu_seconds.median, best = natural.error();
    int in_vain = 0;
    for (double step = start / factor; study_.rows.size() < first + longest_ladder; step /= factor) {
      if (cpu_seconds * factor > options_.run_budget)
        return fmt::format("the next run would take about {:.2g} s", cpu_seconds * factor);
      const double part =
          0.95 * std::min(1.0, static_cast<double>(study_.rows.size() - first) / usual_ladder);
      const StudyRow& row = run_row(series, step, part);
      cpu_seconds = row.cpu_seconds.median;
      if (!row.ok()) continue;
      in_vain = best < plateau_ceiling && row.error() > still_falling * best ? in_vain + 1 : 0;
      best = std::isnan(best) ? row.error() : std::min(best, row.error());
      if (in_vain == plateau_length) return fmt::format("round-off keeps the error above {:.1e}", best);
    }
    return fmt::format("{} runs", longest_ladder);
  }

  void coarsen(const Series& series, double factor, double error) {
    const double length = std::abs(study_.t_end - study_.t_start);
    for (double step = natural_step_ * factor; error < coarse_error; step *= factor) {
      if (std::abs(step) * fewest_steps > length) return;
      error = run_row(series, step, 0.1).error();
    }
  }

  std::vector<DaeFormulation> formulations(const std::string& baseline, const std::vector<double>& rtols,
                                           double part) const {
    if (baseline != ida_method) return {DaeFormulation::rates};  // it has none
    if (options_.ida_formulation) return {*options_.ida_formulation};
    if (!reference_.missing.empty()) return {DaeFormulation::rates};
    return best_formulations(*entry_.scene, study_.t_end, rtols, reference_, options_.run_budget,
                             [&] { look(part, "the formulations of IDA"); });
  }

  void run_baseline_ladder(const std::string& baseline, double part) {
    std::vector<double> rtols = options_.rtols;
    std::ranges::sort(rtols, std::greater{});
    for (const DaeFormulation formulation : formulations(baseline, rtols, part))
      run_baseline_ladder(baseline, formulation, rtols, part);
  }

  void run_baseline_ladder(const std::string& baseline, DaeFormulation formulation,
                           const std::vector<double>& rtols, double part) {
    const std::size_t first = study_.rows.size();
    std::vector<Sample> ends(rtols.size());
    const auto run = [&](double rtol, int repeats, Sample& end) {
      return run_baseline(baseline, *entry_.scene, study_.t_end, {.rtol = rtol, .formulation = formulation},
                          repeats, reference_, end);
    };
    for (std::size_t i = 0; i < rtols.size(); ++i) {
      look(part, fmt::format("{}, rtol {:g}", baseline, rtols[i]));
      study_.rows.push_back(run(rtols[i], options_.repeats, ends[i]));
      if (i > 0) compare(study_.rows[first + i - 1], ends[i - 1], study_.rows[first + i].ok(), ends[i]);
    }
    if (rtols.empty() || rtols.back() < 1e-13) return;
    Sample tighter;  // for the last row's own estimate only
    const StudyRow row = run(0.1 * rtols.back(), 1, tighter);
    compare(study_.rows.back(), ends.back(), row.ok(), tighter);
  }

  static void compare(StudyRow& row, const Sample& end, bool tighter_ok, const Sample& tighter) {
    if (!row.ok() || !tighter_ok) return;
    row.self_error = std::max(relative_error(end.q, tighter.q), relative_error(end.p, tighter.p));
  }

  CatalogueScene entry_;  ///< with a Lagrangian, derived where the scene has none
  const Registry& registry_;
  const SolverFactory& solvers_;
  const StudyOptions& options_;
  const StudyObserver& observer_;
  double natural_step_ = 0.0;
  std::vector<Series> series_;
  std::size_t series_done_ = 0;
  ReferenceEnd reference_;
  Study study_;
};

std::vector<WorkPoint> points(const Study& study, const std::string& method, int order) {
  std::vector<WorkPoint> found;
  for (const StudyRow& row : study.rows)
    if (row.ok() && row.method == method && row.order == order)
      found.push_back({row.step, std::max(row.error(), smallest_error), row.cpu_seconds.median});
  return found;
}

}  // namespace

std::vector<int> possible_orders(const MethodInfo& method) {
  std::vector<int> orders{composition_orders.begin(), composition_orders.end()};
  if (method.order == 1) orders.insert(orders.begin(), 1);
  if (method.order == 1 || (method.order == 2 && method.self_adjoint)) return orders;
  return {method.order};
}

const char* name(Momentum momentum) {
  switch (momentum) {
    case Momentum::plus:
      return "plus";
    case Momentum::minus:
      return "minus";
    case Momentum::projected:
      return "projected";
  }
  return "unknown";
}

Study convergence_study(const CatalogueScene& scene, const Registry& registry, const SolverFactory& solvers,
                        const StudyOptions& options, const StudyObserver& observer) {
  return StudyInProgress(scene, registry, solvers, options, observer).run();
}

void conclude(Study& study) {
  for (MeasuredOrder& measured : study.measured_orders) {
    const auto fit = measure_order(points(study, measured.method, measured.order));
    measured.slope = fit ? std::optional(fit->slope) : std::nullopt;
    measured.points = fit ? fit->points : 0;
  }
  study.at_error.clear();
  const std::vector<WorkPoint> ida = points(study, ida_method, 0), erk = points(study, erk_method, 0);
  for (const double error : compared_errors) {
    const std::size_t first = study.at_error.size();
    const auto ida_seconds = cpu_seconds_at(ida, error), erk_seconds = cpu_seconds_at(erk, error);
    std::optional<std::size_t> best;
    for (const MeasuredOrder& ours : study.measured_orders) {
      AtError at{.error = error,
                 .method = ours.method,
                 .order = ours.order,
                 .ida_cpu_seconds = ida_seconds,
                 .erk_cpu_seconds = erk_seconds};
      at.cpu_seconds = cpu_seconds_within(points(study, ours.method, ours.order), error);
      if (at.cpu_seconds && ida_seconds) at.ratio = *ida_seconds / *at.cpu_seconds;
      if (at.cpu_seconds && erk_seconds) at.erk_ratio = *erk_seconds / *at.cpu_seconds;
      study.at_error.push_back(at);
      if (at.cpu_seconds && (!best || *at.cpu_seconds < *study.at_error[*best].cpu_seconds))
        best = study.at_error.size() - 1;
    }
    if (best) {
      study.at_error[*best].best = true;
      std::rotate(study.at_error.begin() + static_cast<std::ptrdiff_t>(first),
                  study.at_error.begin() + static_cast<std::ptrdiff_t>(*best),
                  study.at_error.begin() + static_cast<std::ptrdiff_t>(*best) + 1);
    }
  }
}

bool confirms_order(const MeasuredOrder& measured, double tolerance) {
  return measured.slope && std::abs(*measured.slope - measured.order) <= tolerance;
}

}  // namespace diracstep
