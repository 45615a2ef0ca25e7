#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/core/adaptive/adaptive_run.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/runs/step_loop.hpp>
#include <diracstep/core/system/multiplier_rows.hpp>
#include <diracstep/validation/references/explicit_reference.hpp>
#include <diracstep/validation/references/ida_reference.hpp>
#include <diracstep/validation/studies/study_run.hpp>
#include <diracstep/validation/studies/work_precision.hpp>

namespace diracstep {

namespace {

constexpr double long_run = 0.03;         // CPU seconds above which a run is repeated less often
constexpr double own_warm_up = 0.1;       // … above which it is not run once more to warm up
constexpr double reference_rtol = 1e-13;  // of IDA, where a scene has no reference
constexpr long steps_between_looks = 256;

CpuSeconds summary(std::vector<double> seconds) {
  std::ranges::sort(seconds);
  const std::size_t n = seconds.size();
  const double median = n % 2 == 1 ? seconds[n / 2] : 0.5 * (seconds[n / 2 - 1] + seconds[n / 2]);
  return {median, seconds.front(), seconds.back(), static_cast<int>(n)};
}

/// Times a run as often as its length allows; `run` returns its CPU seconds, or a negative number to stop.
template <class Run>
CpuSeconds repeat(Run run, int repeats) {
  const double first = run();
  if (first < 0.0) return {};
  if (first > own_warm_up) return summary({first});
  const int count = first <= long_run ? repeats : std::max(1, static_cast<int>(repeats * long_run / first));
  std::vector<double> seconds;
  for (int i = 0; i < count; ++i) seconds.push_back(run());
  return summary(std::move(seconds));
}

double violation(const ConstraintRows& rows, const Sample& end) {
  Vector a(rows.pattern().nonzeros()), residual(rows.rows()), phi = Vector::Zero(rows.rows());
  rows.coefficients(end.time, end.q, a, residual);
  rows.pattern().multiply_add(a.data(), end.v.data(), residual.data());
  if (rows.holonomic()) rows.position(end.time, end.q, phi);
  const int shown = rows_at_shown_points(rows);
  return std::max(max_norm(residual.head(shown)), max_norm(phi.head(shown)));
}

/// In the first formulation that completes of those that keep φ = 0.
ReferenceEnd true_end_by_ida(const Scene& scene, double t_end, const std::function<void()>& look) {
  ReferenceRun fine;
  ReferenceOptions options{.rtol = reference_rtol, .look = look};
  for (const DaeFormulation formulation :
       {DaeFormulation::rates, DaeFormulation::rates_loose, DaeFormulation::index_2}) {
    options.formulation = formulation;
    fine = integrate_with_ida(scene, t_end, options);
    if (fine.ok() || scene.rows() == 0) break;
  }
  options.rtol *= 10.0;
  const ReferenceRun coarse = fine.ok() ? integrate_with_ida(scene, t_end, options) : ReferenceRun{};
  ReferenceEnd reference{.kind = ida_method,
                         .how = fmt::format("IDA at rtol {:g}, beside {:g}", reference_rtol, options.rtol),
                         .missing = fine.ok() ? "" : "no reference: IDA stopped: " + fine.failure,
                         .q = fine.end.q,
                         .p = fine.end.p,
                         .space = scene.space};
  if (options.formulation != DaeFormulation::rates)
    reference.how += std::string(", formulation ") + name(options.formulation);
  if (fine.ok() && coarse.ok()) reference.self_error = reference.distance(coarse.end);
  return reference;
}

/// The start, the steps and the reading of the end.  Empty, or why that failed; `looking` is time spent in
/// `look`.
std::string run_once(Integrator& integrator, long steps, Momentum momentum, const Look& look, Sample& end,
                     double& looking) {
  integrator.reset();
  const auto look_around = [&](long k) {
    if (!look || k % steps_between_looks != 0) return true;
    const double before = thread_seconds();
    look();
    looking += thread_seconds() - before;
    return true;
  };
  const StepReport last = step_while(
      integrator, [steps](long k) { return k < steps; }, look_around);
  if (!last.ok()) return last.failure;
  const SolveReport reading = integrator.sample(momentum, end);
  if (reading.ok()) return {};
  return fmt::format("reading the state at t = {}: {}", integrator.time(), describe(reading.status));
}

}  // namespace

double ReferenceEnd::distance(const Sample& given) const {
  const Sample end = in_frames_of(q, given, space.get());
  return p.size() == 0 ? relative_error(end.q, q)
                       : std::max(relative_error(end.q, q), relative_error(end.p, p));
}

double largest_violation(const Scene& scene, const Sample& at) {
  double largest = 0.0;
  for (const auto& rows : scene.constraints) largest = std::max(largest, violation(*rows, at));
  return largest;
}

std::optional<ReferenceEnd> known_point(const CatalogueScene& scene, double t) {
  const auto point = scene.reference.at ? scene.reference.at(t) : std::nullopt;
  if (!point) return std::nullopt;
  ReferenceEnd reference{.kind = scene.reference.kind,
                         .how = scene.reference.how,
                         .self_error = scene.reference.self_error,
                         .missing = {},
                         .q = point->q,
                         .p = Vector::Zero(scene.scene->dimension()),
                         .space = scene.scene->space};
  Vector force = reference.p;
  const auto lagrangian = completed(scene.scene)->lagrangian;
  if (lagrangian)
    lagrangian->gradient(t, point->q, point->v, force, reference.p);
  else
    reference.p.resize(0);
  return reference;
}

ReferenceEnd reference_end(const CatalogueScene& scene, double t_end, const std::function<void()>& look) {
  if (auto known = known_point(scene, t_end)) return *std::move(known);
  return true_end_by_ida(*completed(scene.scene), t_end, look);
}

namespace {

/// Sizes of q and p that zero is told by: the largest of the start and the reference, and what the speed, the
/// force F = ∂L/∂q + f and the masses m = ∂²L/∂v_i² of the start make of each other in the time between:
/// m |q|/t and √(m F |q|).  Not those of the run, which may be as wrong as can be.
struct NaturalSizes {
  double q, p;
};

NaturalSizes natural_sizes(const Scene& scene, const ReferenceEnd& reference, double t_end) {
  const Start& start = scene.start;
  const double time = std::abs(t_end - start.time), speed = max_norm(start.v);
  const double q = std::max({max_norm(start.q), max_norm(reference.q), speed * time});
  double mass = 0.0;
  if (scene.lagrangian) {
    const SparsityPattern& pattern = scene.lagrangian->pattern();
    Vector qq(pattern.nonzeros()), qv(pattern.nonzeros()), vv(pattern.nonzeros());
    scene.lagrangian->hessian(start.time, start.q, start.v, qq, qv, vv);
    pattern.for_each([&](Eigen::Index k, int i, int j) {
      if (i == j && std::isfinite(vv[k])) mass = std::max(mass, std::abs(vv[k]));
    });
  }
  Vector force(scene.dimension()), momentum(force.size()), own = Vector::Zero(force.size());
  scene.force_and_momentum(start.time, start.q, start.v, start.p, force, momentum);
  if (scene.force) scene.force->value(start.time, start.q, start.v, own);
  const double by_force = std::sqrt(mass * max_norm(force + own) * q),
               fastest = time > 0.0 ? std::max(speed, q / time) : speed;
  return {q, std::max({max_norm(start.p), max_norm(reference.p), mass * fastest,
                       std::isfinite(by_force) ? by_force : 0.0})};
}

}  // namespace

void judge(StudyRow& row, const Scene& scene, const Sample& given, const ReferenceEnd& reference) {
  const Sample end = reference.missing.empty() ? in_frames_of(reference.q, given, scene.space.get()) : given;
  const double energy = scene.energy(scene.start);
  row.constraint = largest_violation(scene, end);
  const double change = std::abs(end.energy - energy);
  const double size = std::max({std::abs(energy), std::abs(end.energy), 0.5 * std::abs(end.p.dot(end.v))});
  row.energy_error = change == 0.0 ? 0.0 : change / size;
  if (reference.missing.empty()) {
    const NaturalSizes natural = natural_sizes(scene, reference, end.time);
    row.error_q = relative_error(end.q, reference.q, natural.q);
    if (reference.p.size() > 0) row.error_p = relative_error(end.p, reference.p, natural.p);
  }
  if (!end.q.allFinite() || !end.p.allFinite())
    row.status = "the end point is not finite";
  else if (!reference.missing.empty())
    row.status = reference.missing;
}

namespace {

/// The counts of the work and the errors, or why there are none.
void conclude(StudyRow& row, const Work& work, const std::string& failure, const Scene& scene,
              const Sample& end, const ReferenceEnd& reference) {
  row.steps = work.steps;
  row.newton_iterations = work.iterations;
  row.residual_evaluations = work.residual_evaluations;
  row.jacobian_evaluations = work.jacobian_evaluations;
  if (failure.empty())
    judge(row, scene, end, reference);
  else
    row.status = failure;
}

}  // namespace

StudyRow run_ours(Integrator& integrator, long steps, Momentum momentum, int repeats,
                  const ReferenceEnd& reference, const Look& look) {
  Sample end;
  std::string failure;
  const auto once = [&] {
    double looking = 0.0;
    const double before = thread_seconds();
    failure = run_once(integrator, steps, momentum, look, end, looking);
    return failure.empty() ? thread_seconds() - before - looking : -1.0;
  };
  const IntegratorOptions& options = integrator.options();
  StudyRow row{.method = options.method, .order = options.order, .step = options.step};
  row.cpu_seconds = repeat(once, repeats);
  conclude(row, integrator.work(), failure, integrator.scene(), end, reference);
  return row;
}

StudyRow run_with_events(const CatalogueScene& scene, const Registry& registry, const SolverFactory& solvers,
                         const IntegratorOptions& options, long steps, Momentum momentum, int repeats,
                         const ReferenceEnd& reference, const Look& look) {
  Sample end;
  std::string failure;
  Work work;
  std::shared_ptr<const Scene> last;
  const auto once = [&] {
    EventSteps<Integrator> motion(scene.scene, scene.all_rows, scene.events, solvers, momentum,
                                  integrators(registry, solvers, options));
    double looking = 0.0;
    const double before = thread_seconds();
    const auto look_around = [&](long taken) {
      if (!look || taken % steps_between_looks != 0) return;
      const double pause = thread_seconds();
      look();
      looking += thread_seconds() - pause;
    };
    failure = motion.run(steps, end, look_around).failure;
    const double seconds = thread_seconds() - before - looking;
    work = motion.work();
    last = std::make_shared<const Scene>(motion.scene());
    return failure.empty() ? seconds : -1.0;
  };
  StudyRow row{.method = options.method, .order = options.order, .step = options.step};
  row.cpu_seconds = repeat(once, repeats);
  conclude(row, work, failure, *last, end, reference);
  return row;
}

StudyRow run_variable(AdaptiveIntegrator& integrator, double t_end, Momentum momentum, int repeats,
                      const ReferenceEnd& reference, const Look& look) {
  Sample end;
  std::string failure;
  const auto once = [&] {
    double looking = 0.0;
    long observed = 0;
    const double before = thread_seconds();
    integrator.reset();
    const RunReport report =
        run_until(integrator, t_end, momentum, steps_between_looks, [&](const Sample& sample) {
          end = sample;
          const double pause = thread_seconds();
          if (look && observed++ > 0) look();
          looking += thread_seconds() - pause;
          return true;
        });
    failure = report.last.failure;
    return failure.empty() ? thread_seconds() - before - looking : -1.0;
  };
  const IntegratorOptions& options = integrator.options();
  StudyRow row{
      .method = options.method + variable_steps, .order = options.order, .step = integrator.adaptive().eps};
  row.cpu_seconds = repeat(once, repeats);
  conclude(row, integrator.work(), failure, integrator.integrator().scene(), end, reference);
  return row;
}

namespace {

/// The explicit code that would take the least time for the same error: two runs of each at one tolerance,
/// compared as methods of order 8, of which a tenth of the error takes 10^(1/8) times as long.
ExplicitCode quickest_code(const Scene& scene, double t_end, const ReferenceOptions& options,
                           const ReferenceEnd& reference) {
  constexpr double order_of_all = 8.0, least_error = 1e-16;
  const std::vector<ExplicitCode> codes = explicit_codes(scene);
  if (codes.size() == 1) return codes.front();
  ExplicitCode quickest = codes.front();
  double least = std::numeric_limits<double>::infinity();
  for (const ExplicitCode code : codes) {
    (void)integrate_explicitly(scene, t_end, options, code);
    const ReferenceRun run = integrate_explicitly(scene, t_end, options, code);
    if (!run.ok()) continue;
    const double error = reference.missing.empty() ? reference.distance(run.end) : options.rtol;
    const double time = run.cpu_seconds * std::pow(std::max(error, least_error), 1.0 / order_of_all);
    if (!(time < least)) continue;
    least = time;
    quickest = code;
  }
  return quickest;
}

}  // namespace

StudyRow run_baseline(const std::string& method, const Scene& scene, double t_end,
                      const ReferenceOptions& options, int repeats, const ReferenceEnd& reference,
                      Sample& end) {
  const bool of_ida = method == ida_method;
  const ExplicitCode code = of_ida ? ExplicitCode::arkode : quickest_code(scene, t_end, options, reference);
  ReferenceRun run;
  const auto once = [&] {
    run = of_ida ? integrate_with_ida(scene, t_end, options)
                 : integrate_explicitly(scene, t_end, options, code);
    return run.ok() ? run.cpu_seconds : -1.0;
  };
  StudyRow row{.method = method, .rtol = options.rtol};
  row.formulation = of_ida ? name(options.formulation) : name(code);
  row.cpu_seconds = repeat(once, repeats);
  row.steps = run.steps;
  row.newton_iterations = run.newton_iterations;
  row.residual_evaluations = run.residual_evaluations;
  row.jacobian_evaluations = run.jacobian_evaluations;
  if (run.ok())
    judge(row, scene, run.end, reference);
  else
    row.status = run.failure;
  end = std::move(run.end);
  return row;
}

}  // namespace diracstep
