#include <cmath>
#include <diracstep/core/adaptive/adaptive_run.hpp>
#include <diracstep/core/adaptive/damping_survey.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/validation/studies/damped_motion.hpp>

namespace diracstep {

std::optional<SurveyedMotion> surveyed_motion(const std::shared_ptr<const Scene>& scene,
                                              const Registry& registry, const SolverFactory& solvers,
                                              double t_end, double step) {
  constexpr double coarse = 1e-4;
  try {
    const DampingSurvey survey = survey_damping(scene, registry, solvers, t_end, std::abs(step));
    if (!survey.failure.empty()) return std::nullopt;
    AdaptiveIntegrator integrator(scene, registry, solvers, {.method = "damped/radau:3", .step = step},
                                  {.eps = coarse, .end = t_end});
    const Eigen::Index n = scene->dimension();
    Vector sizes = Vector::Zero(3 * n), here(3 * n);
    const RunReport report = run_until(integrator, t_end, Momentum::projected, 1, [&](const Sample& sample) {
      here << sample.q, sample.v, sample.p;
      sizes = sizes.cwiseMax(here.cwiseAbs());
      return true;
    });
    if (!report.ok()) return std::nullopt;
    return SurveyedMotion{sizes, survey.strong() || survey.switching() || survey.switched()};
  } catch (const Misuse&) {  // told by the rows of the study
    return std::nullopt;
  }
}

}  // namespace diracstep
