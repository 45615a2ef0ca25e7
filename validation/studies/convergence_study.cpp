#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/core/methods/composition.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/plugins/callback_error.hpp>
#include <diracstep/validation/studies/converged_reference.hpp>
#include <diracstep/validation/studies/convergence_study.hpp>
#include <diracstep/validation/studies/damped_motion.hpp>
#include <diracstep/validation/studies/formulation_choice.hpp>
#include <diracstep/validation/studies/work_precision.hpp>
#include <utility>

namespace diracstep {

namespace {

constexpr double coarse_error = 1e-2;    // a ladder begins at a step with at least this error
constexpr double improves_little = 0.7;  // an order-1 method halves the error where the step is halved
constexpr int plateau_length = 2;        // refinements in vain that end a ladder
constexpr double usual_ladder = 12.0;    // rows, for the progress only
constexpr std::size_t longest_ladder = 40;
constexpr double fewest_steps = 2.0;
constexpr double natural_eps = 1.0;  // radians of the coarsest variable step
constexpr double coarsest_local_error = 1e-2, finer_local_error = 10.0, its_cost = 1.5;
constexpr double more_steps = 1.3;  // else the period of a force sets the steps, not their local error
constexpr long most_steps_in_limited_time = 200'000;  // of a baseline: some tenths of a second
constexpr double of_a_share = 0.03;           // of a ladder's time, for a run that compares formulations
constexpr double ladders_of_baselines = 3.0;  // times the length of one of ours

struct Interrupted {};

/// Ends a reference by IDA from within.
struct OutOfTime {};

class StudyInProgress {
 public:
  StudyInProgress(const CatalogueScene& scene, const Registry& registry, const SolverFactory& solvers,
                  const StudyOptions& options, const StudyObserver& observer)
      : entry_(scene), registry_(registry), solvers_(solvers), options_(options), observer_(observer) {
    entry_.scene = completed(scene.scene);
    if (std::ranges::none_of(entry_.events, [](const Event& event) { return event.acts() || event.stop; }))
      entry_.events.clear();  // what is only noted does not change the motion
    study_.scene = entry_.scene->name;
    study_.parameters = scene.parameters;
    study_.t_start = entry_.scene->start.time;
    study_.t_end = options.t_end.value_or(scene.t_end);
    study_.unknowns = entry_.scene->dimension() + entry_.scene->rows();
    study_.momentum = options.momentum;
    natural_step_ = std::copysign(scene.natural_step, study_.t_end - study_.t_start);
    require_options();
    if (!options_.series.empty() || !options_.rtols.empty())
      surveyed_ = surveyed_motion(entry_.scene, registry_, solvers_, study_.t_end, natural_step_);
    if (damped() && !options_.series.empty())
      for (const char* method : {"damped/radau:3", "damped/radau:5"})
        series_.push_back({method, registry_.method(method).info.order, true});
    for (const auto& [method, order] : options_.series)
      if (!damped() || method == "type1/gl:3") add(chosen(method, order));
    if (options_.series.empty())
      for (const auto& method : options_.methods)
        for (const int order : orders_of(method)) add(chosen(method, order));
    if (!options_.series.empty())
      std::erase_if(series_, [&](const Series& s) { return !refusal(s).empty(); });
    require_one_that_fits();
  }

  Study run() {
    begin_ = thread_seconds();
    try {
      look(0.0, "reference");
      reference_ = reference();
      study_.reference_kind = reference_.kind;
      study_.reference_how = reference_.how;
      study_.reference_error = reference_.self_error;
      for (; series_done_ < series_.size(); ++series_done_) run_series(series_[series_done_]);
      for (std::size_t i = 0; i < options_.baselines.size() && entry_.events.empty(); ++i)
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

  void add(const Series& series) {
    series_.push_back(series);
    if (options_.adaptive && entry_.events.empty()) series_.push_back(series.with_variable_steps());
  }

  bool damped() const { return surveyed_ && surveyed_->damped; }
  Vector sizes() const { return surveyed_ ? surveyed_->sizes : Vector(); }

  /// With steps by their local error, whose ladder is one of eps.
  bool by_local_error(const Series& series) const {
    return series.variable && registry_.method(series.method).info.damped;
  }

  ReferenceEnd reference() const {
    if (auto known = known_point(entry_, study_.t_end)) return *std::move(known);
    ReferenceEnd ours = converged_reference(
        entry_, registry_, solvers_, study_.t_end, options_.reference_budget,
        [&] { look(0.0, "a converged reference"); }, damped());
    if (ours.missing.empty() || !entry_.events.empty()) return ours;  // IDA knows no events
    const double begin = thread_seconds(), seconds = std::max(options_.reference_budget, options_.run_budget);
    try {
      return reference_end(entry_, study_.t_end, [&] {
        look(0.0, "a reference by IDA");
        if (thread_seconds() - begin > seconds) throw OutOfTime{};
      });
    } catch (const OutOfTime&) {
      ours.missing += fmt::format("; IDA has not come to the end within {:g} s", seconds);
      ours.how = ours.missing;
      return ours;
    }
  }

  /// CPU seconds that the ladder which begins now may take: an even share of what is left.
  double share_of_time() const {
    const double left = options_.time_limit - (thread_seconds() - begin_);
    const double ladders = static_cast<double>(series_.size() - series_done_) +
                           (series_done_ < series_.size() ? ladders_of_baselines : 1.0);
    return left / ladders;
  }

  void require_options() const {
    if (options_.methods.empty() && options_.series.empty())
      throw Misuse("a study needs at least one method");
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

  /// Empty, or why the scene does not take a method at an order.
  std::string refusal(const Series& series) const {
    try {
      (void)integrator(series, natural_step_);
      return {};
    } catch (const Misuse& misuse) {
      return misuse.what();
    }
  }

  /// A method or order that fits nothing is a mistake; one of several that does not fit becomes a row.
  void require_one_that_fits() const {
    std::string reason = series_.empty() ? "none of the methods fits the scene" : "";
    for (const Series& series : series_) {
      const std::string why = refusal(series);
      if (why.empty()) return;
      if (reason.empty()) reason = why;
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
    if (!entry_.events.empty())
      return study_.rows.emplace_back(
          run_with_events(entry_, registry_, solvers_, integrator_options(series, grid.step), grid.steps,
                          options_.momentum, options_.repeats, reference_, look_around));
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
    const bool local = by_local_error(series);
    const double factor = local ? finer_local_error : series.order > 4 ? std::sqrt(2.0) : 2.0;
    const double cost = local ? its_cost : factor;
    const std::size_t first = study_.rows.size();
    const double start = local             ? coarsest_local_error
                         : series.variable ? natural_eps
                                           : natural_step_,
                 time = share_of_time();
    const double begin = thread_seconds();
    const StudyRow natural = run_row(series, start, 0.0);
    if (!series.variable) coarsen(series, factor, natural.error());
    double cpu_seconds = natural.cpu_seconds.median, best = natural.error();
    int in_vain = 0;
    auto steps = static_cast<double>(natural.steps);
    const double smallest = std::isfinite(reference_.self_error) ? reference_.self_error : 0.0;
    for (double step = start / factor; study_.rows.size() < first + longest_ladder; step /= factor) {
      if (cpu_seconds * cost > options_.run_budget)
        return fmt::format("the next run would take about {:.2g} s", cpu_seconds * cost);
      if (thread_seconds() - begin + cpu_seconds * cost * (1.0 + options_.repeats) > time)
        return "its share of the time of the study is used up";
      const double part =
          0.95 * std::min(1.0, static_cast<double>(study_.rows.size() - first) / usual_ladder);
      const StudyRow& row = run_row(series, step, part);
      cpu_seconds = row.cpu_seconds.median;
      if (!row.ok()) continue;
      if (!local || static_cast<double>(row.steps) > more_steps * steps) {
        in_vain = best < plateau_ceiling && row.error() > improves_little * best ? in_vain + 1 : 0;
        steps = static_cast<double>(row.steps);
      }
      best = std::isnan(best) ? row.error() : std::min(best, row.error());
      if (row.error() < smallest) return fmt::format("the reference is known to {:.1e} only", smallest);
      if (in_vain == plateau_length)
        return best < near_the_reference * smallest
                   ? fmt::format("the reference, known to {:.1e} only, hides smaller errors", smallest)
                   : fmt::format("round-off keeps the error above {:.1e}", best);
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
    return best_formulations(
        *entry_.scene, study_.t_end, rtols, reference_,
        std::min(options_.run_budget, of_a_share * share_of_time()),
        [&] { look(part, "the formulations of IDA"); }, sizes());
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
    const double begin = thread_seconds();
    const double time = share_of_time();
    std::vector<Sample> ends(rtols.size());
    const auto run = [&](double rtol, int repeats, Sample& end) {
      ReferenceOptions reference{.rtol = rtol, .sizes = sizes(), .formulation = formulation};
      reference.look = [&] { look(part, fmt::format("{}, rtol {:g}", baseline, rtol)); };
      if (std::isfinite(options_.time_limit)) reference.max_steps = most_steps_in_limited_time;
      return run_baseline(baseline, *entry_.scene, study_.t_end, reference, repeats, reference_, end);
    };
    for (std::size_t i = 0; i < rtols.size(); ++i) {
      look(part, fmt::format("{}, rtol {:g}", baseline, rtols[i]));
      study_.rows.push_back(run(rtols[i], options_.repeats, ends[i]));
      if (i > 0) compare(study_.rows[first + i - 1], ends[i - 1], study_.rows[first + i].ok(), ends[i]);
      if (study_.rows.back().error() < options_.smallest_error) return;
      if (thread_seconds() - begin + 1.5 * study_.rows.back().cpu_seconds.median * (1.0 + options_.repeats) >
          time)
        return;
    }
    if (rtols.empty() || rtols.back() < 1e-13) return;
    Sample tighter;  // for the last row's own estimate only
    const StudyRow row = run(0.1 * rtols.back(), 1, tighter);
    compare(study_.rows.back(), ends.back(), row.ok(), tighter);
  }

  void compare(StudyRow& row, const Sample& given, bool tighter_ok, const Sample& tighter) const {
    if (!row.ok() || !tighter_ok) return;
    const Sample end = in_frames_of(tighter.q, given, entry_.scene->space.get());
    row.self_error = std::max(relative_error(end.q, tighter.q), relative_error(end.p, tighter.p));
  }

  CatalogueScene entry_;  ///< with a Lagrangian, derived where the scene has none
  const Registry& registry_;
  const SolverFactory& solvers_;
  const StudyOptions& options_;
  const StudyObserver& observer_;
  double natural_step_ = 0.0;
  std::optional<SurveyedMotion> surveyed_;
  std::vector<Series> series_;
  std::size_t series_done_ = 0;
  ReferenceEnd reference_;
  double begin_ = 0.0;  ///< of the study, CPU time
  Study study_;
};

}  // namespace

std::vector<int> possible_orders(const MethodInfo& method) {
  if (method.damped) return {method.order};
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

}  // namespace diracstep
