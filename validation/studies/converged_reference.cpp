#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/adaptive/adaptive_run.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/event_steps.hpp>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/core/runs/step_loop.hpp>
#include <diracstep/validation/studies/converged_reference.hpp>
#include <diracstep/validation/studies/work_precision.hpp>
#include <span>

namespace diracstep {

namespace {

struct Ladder {
  const char* method;
  int order;
};
constexpr std::array<Ladder, 4> reference_ladders{
    {{"type1/gl:6", 12}, {"type1/gl:4", 8}, {"type1/midpoint", 8}, {"type1/trapezoidal", 8}}};

constexpr std::array<Ladder, 2> damped_ladders{{{"damped/radau:5", 9}, {"damped/radau:4", 7}}};
constexpr double coarse_local_error = 1e-4, finer_local_errors = 0.1, smallest_local_error = 1e-13;
constexpr double converged = 1e-6;  ///< a change above it is never taken for round-off
constexpr double still_falling = 0.5;
constexpr double smallest_claim = 1e-15;  ///< the rounding of the reference itself
constexpr double first_step = 8.0;        ///< times the scene's own
constexpr long steps_per_look = 256;
constexpr int most_halvings = 30;

double distance(const Sample& given, const Sample& b, const Scene& scene) {
  const Sample a = in_frames_of(b.q, given, scene.space.get());
  return std::max(relative_error(a.q, b.q), relative_error(a.p, b.p));
}

/// Where one method comes to.
struct Refined {
  std::string method, failure;
  int order = 0;
  double step = 0.0;
  double change = StudyRow::none;  ///< of the end by the last halving of the step
  Sample end;

  bool ok() const { return std::isfinite(change); }
};

class Refinement {
 public:
  Refinement(const CatalogueScene& scene, const Registry& registry, const SolverFactory& solvers,
             double t_end, const Look& look, bool damped)
      : scene_(scene), registry_(registry), solvers_(solvers), t_end_(t_end), look_(look), damped_(damped) {}

  Refined refined(const Ladder& by, double seconds) const {
    Refined best;
    best.method = by.method;
    best.order = by.order;
    const double begin = thread_seconds(), start = scene_.scene->start.time;
    const double length = t_end_ - start;
    double step = damped_ ? coarse_local_error
                          : std::copysign(std::min(first_step * scene_.natural_step, 0.5 * std::abs(length)),
                                          length),
           last = 0.0;
    Sample before;
    bool any = false;
    for (int k = 0; k < most_halvings && (k == 0 || thread_seconds() - begin + 2.0 * last < seconds);
         ++k, step *= damped_ ? finer_local_errors : 0.5) {
      if (damped_ && step < smallest_local_error) break;
      const double run_begin = thread_seconds();
      Sample end;
      best.failure = damped_ ? run_by_local_error(by, step, end) : run(by, step, end);
      last = thread_seconds() - run_begin;
      if (!best.failure.empty()) continue;  // a shorter step may be solved
      if (any) {
        const double change = distance(before, end, *scene_.scene);
        const bool falls = std::isnan(best.change) || change < still_falling * best.change;
        if (!falls && best.change < converged) break;
        if (falls) {
          best.change = change;
          best.step = step;
          best.end = end;
        }
        if (change == 0.0) break;
      }
      any = true;
      before = std::move(end);
    }
    return best;
  }

 private:
  std::string run(const Ladder& by, double step, Sample& end) const {
    const StepGrid grid = fit_steps(scene_.scene->start.time, t_end_, step);
    if (!scene_.events.empty()) {
      EventSteps<Integrator> motion(
          scene_.scene, scene_.all_rows, scene_.events, solvers_, Momentum::projected,
          integrators(registry_, solvers_, {.method = by.method, .order = by.order, .step = grid.step}));
      const auto look = [&](long taken) {
        if (look_ && taken % steps_per_look == 0) look_();
      };
      return motion.run(grid.steps, end, look).failure;
    }
    Integrator integrator = made(by, grid.step);
    const StepReport last = step_while(
        integrator, [&](long k) { return k < grid.steps; },
        [&](long k) {
          if (look_ && k % steps_per_look == 0) look_();
          return true;
        });
    if (!last.ok()) return last.failure;
    const SolveReport reading = integrator.sample(Momentum::projected, end);
    return reading.ok() ? "" : describe(reading.status);
  }

  std::string run_by_local_error(const Ladder& by, double eps, Sample& end) const {
    AdaptiveIntegrator integrator(scene_.scene, registry_, solvers_,
                                  {.method = by.method, .order = by.order, .step = scene_.natural_step},
                                  {.eps = eps, .end = t_end_});
    const RunReport report =
        run_until(integrator, t_end_, Momentum::projected, steps_per_look, [&](const Sample& sample) {
          end = sample;
          if (look_) look_();
          return true;
        });
    return report.last.failure;
  }

  Integrator made(const Ladder& by, double step) const {
    IntegratorOptions options{.method = by.method, .order = by.order, .step = step};
    options.compensated_sums = true;
    try {
      return {scene_.scene, registry_, solvers_, options};
    } catch (const Misuse&) {  // this step has no compensated sums, or the scene does not take the method
      options.compensated_sums = false;
      return {scene_.scene, registry_, solvers_, options};
    }
  }

  const CatalogueScene& scene_;
  const Registry& registry_;
  const SolverFactory& solvers_;
  double t_end_;
  const Look& look_;
  bool damped_;
};

}  // namespace

ReferenceEnd converged_reference(const CatalogueScene& scene, const Registry& registry,
                                 const SolverFactory& solvers, double t_end, double seconds, const Look& look,
                                 bool damped) {
  const Refinement refinement(scene, registry, solvers, t_end, look, damped);
  std::vector<Refined> found;
  ReferenceEnd reference{.kind = "converged", .how = {}, .missing = {}, .q = {}, .p = {}};
  const std::span<const Ladder> ladders =
      damped ? std::span<const Ladder>(damped_ladders) : std::span<const Ladder>(reference_ladders);
  for (const Ladder& candidate : ladders) {
    if (found.size() == 2) break;
    try {
      Refined one = refinement.refined(candidate, 0.5 * seconds);
      if (one.ok())
        found.push_back(std::move(one));
      else
        reference.missing = fmt::format("{} of order {}: {}", one.method, one.order,
                                        one.failure.empty() ? "out of time" : one.failure);
    } catch (const Misuse& misuse) {
      reference.missing = misuse.what();
    }
  }
  if (found.size() < 2) {
    reference.missing = "no reference: two methods are needed that come to the end; " + reference.missing;
    return reference;
  }
  if (found[1].change < found[0].change) std::swap(found[0], found[1]);
  reference.missing.clear();
  reference.q = found[0].end.q;
  reference.p = found[0].end.p;
  reference.space = scene.scene->space;
  reference.self_error = std::max(
      {found[0].change, found[1].change, distance(found[1].end, found[0].end, *scene.scene), smallest_claim});
  reference.how = fmt::format("{} of order {} at {} {:.3g} and its {}, beside {} of order {} at {:.3g}",
                              found[0].method, found[0].order, damped ? "eps" : "step", found[0].step,
                              damped ? "tenfold" : "double", found[1].method, found[1].order, found[1].step);
  return reference;
}

}  // namespace diracstep
