#include <algorithm>
#include <cmath>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/validation/references/reference_run.hpp>
#include <diracstep/validation/studies/convergence_study.hpp>

namespace diracstep {

double expected_seconds(const CatalogueScene& scene, const Registry& registry, const SolverFactory& solvers,
                        const StudyOptions& options) {
  constexpr long probed = 8;                   // steps
  constexpr double longest_ladder_runs = 3.0;  // a ladder takes about so many times its longest run …
  constexpr double usual_ladder_runs = 60.0;   // … or of the run with the natural step
  constexpr double baselines = 4.0;            // as many ladders
  const double t_end = options.t_end.value_or(scene.t_end), length = t_end - scene.scene->start.time;
  const StepGrid grid = fit_steps(scene.scene->start.time, t_end, std::copysign(scene.natural_step, length));
  double seconds = options.run_budget;
  try {
    Integrator integrator(scene.scene, registry, solvers, {.method = "type1/gl:3", .step = grid.step});
    const double before = thread_seconds();
    long taken = 0;
    while (taken < std::min(probed, grid.steps) && integrator.step().ok()) ++taken;
    if (taken > 0)
      seconds = (thread_seconds() - before) / static_cast<double>(taken) * static_cast<double>(grid.steps);
  } catch (const Misuse&) {  // the study itself says why
  }
  const double ladder = std::min(longest_ladder_runs * options.run_budget, usual_ladder_runs * seconds);
  const auto ladders =
      static_cast<double>(options.series.empty() ? options.methods.size() : options.series.size());
  return std::min(options.time_limit, (ladders + baselines) * (1.0 + options.repeats) * ladder);
}

}  // namespace diracstep
