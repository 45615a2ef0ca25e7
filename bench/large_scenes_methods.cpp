/// Which method a large sparse scene should take: processor time of GL(s) through KLU and of compositions of
/// the midpoint step at equal error, on chains of links (rows) and Toda lattices (no rows) of growing size.
/// The reference is GL(6) with a step 8 times finer than the scene's own.
#include <cstdio>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <diracstep/validation/studies/convergence_study.hpp>

#include "timing.hpp"

namespace {

using namespace diracstep;

constexpr double errors[] = {1e-3, 1e-6, 1e-9};

struct LargeScene {
  const char* name;
  int n;
  double t_end, step;
};

/// The scene with GL(6)'s end point as its reference.
CatalogueScene with_own_reference(const LargeScene& large, const Registry& registry) {
  CatalogueScene entry = make_scene(large.name, {{"N", large.n}});
  entry.natural_step = large.step;
  const StepGrid grid = fit_steps(0.0, large.t_end, large.step / 8.0);
  Integrator integrator(entry.scene, registry, kinsol(), {.method = "type1/gl:6", .step = grid.step});
  Sample end;
  const RunReport report = run_steps(integrator, grid.steps, Momentum::projected, grid.steps, nullptr);
  if (!report.ok() || !integrator.sample(Momentum::projected, end).ok())
    std::printf("no reference: %s\n", report.last.failure.c_str());
  entry.reference = {"own", "GL(6)", 0.0, [end](double) {
                       return std::optional(ReferencePoint{end.q, end.v});
                     }};
  return entry;
}

void compare(const LargeScene& large) {
  const Registry registry = Registry::with_built_ins();
  const CatalogueScene entry = with_own_reference(large, registry);
  StudyOptions options;
  options.methods = {"type1/trapezoidal", "type1/midpoint", "type1/gl:2",
                     "type1/gl:3",        "type1/gl:4",     "type1/gl:6"};
  options.rtols = {};
  options.repeats = 1;
  options.t_end = large.t_end;
  const Study study = convergence_study(entry, registry, kinsol(), options);
  std::printf("\n%s, N = %d, t = %g: ms to errors", large.name, large.n, large.t_end);
  for (const double error : errors) std::printf("%9.0e", error);
  for (const MeasuredOrder& series : study.measured_orders) {
    std::printf("\n  %-16s order %2d        ", series.method.c_str(), series.order);
    for (const double error : errors)
      for (const AtError& at : study.at_error)
        if (at.error == error && at.method == series.method && at.order == series.order)
          at.cpu_seconds ? std::printf("%9.2f", 1e3 * *at.cpu_seconds) : std::printf("%9s", "-");
  }
  std::printf("\n");
  std::fflush(stdout);
}

}  // namespace

int main() {
  for (const LargeScene& large : {LargeScene{"toda_200", 16, 10.0, 0.4},
                                  {"toda_200", 200, 10.0, 0.4},
                                  {"toda_200", 1000, 10.0, 0.4},
                                  {"hanging_chain", 16, 0.2, 0.01},
                                  {"hanging_chain", 64, 0.05, 0.0025},
                                  {"hanging_chain", 256, 0.0125, 0.000625}})
    compare(large);
}
