#include <algorithm>
#include <array>
#include <diracstep/validation/references/ida_reference.hpp>
#include <diracstep/validation/studies/formulation_choice.hpp>
#include <diracstep/validation/studies/work_precision.hpp>
#include <limits>

namespace diracstep {

namespace {

constexpr std::array<double, 3> judged_errors{1e-6, 1e-3, 1e-9};
constexpr double nearly = 1.1;

struct Candidate {
  DaeFormulation formulation;
  std::vector<WorkPoint> points;  ///< of the runs that completed
};

Candidate tried(DaeFormulation formulation, const Scene& scene, double t_end,
                const std::vector<double>& rtols, const ReferenceEnd& reference, double budget,
                const Look& look, const Vector& sizes) {
  Candidate candidate{formulation, {}};
  for (const double rtol : rtols) {
    if (look) look();
    const ReferenceRun run = integrate_with_ida(
        scene, t_end, {.rtol = rtol, .sizes = sizes, .formulation = formulation, .look = look});
    if (run.ok()) candidate.points.push_back({rtol, reference.distance(run.end), run.cpu_seconds});
    if (run.cpu_seconds > budget) break;
  }
  return candidate;
}

/// The fastest at an error, or one of the chosen that is nearly as fast; nothing where none reaches it.
const Candidate* fastest_at(double error, const std::vector<Candidate>& all,
                            const std::vector<DaeFormulation>& chosen) {
  const Candidate* best = nullptr;
  double least = std::numeric_limits<double>::infinity();
  for (const Candidate& candidate : all) {
    const auto seconds = cpu_seconds_within(candidate.points, error);
    if (!seconds) continue;
    const bool known = std::ranges::find(chosen, candidate.formulation) != chosen.end();
    if (const double judged = known ? *seconds / nearly : *seconds; judged < least) {
      best = &candidate;
      least = judged;
    }
  }
  return best;
}

}  // namespace

std::vector<DaeFormulation> best_formulations(const Scene& scene, double t_end,
                                              const std::vector<double>& rtols, const ReferenceEnd& reference,
                                              double budget, const Look& look, const Vector& sizes) {
  const std::vector<DaeFormulation> formulations = formulations_of(scene);
  if (formulations.size() == 1 || rtols.empty()) return {DaeFormulation::rates};
  std::vector<Candidate> all;
  for (const DaeFormulation formulation : formulations)
    all.push_back(tried(formulation, scene, t_end, rtols, reference, budget, look, sizes));
  std::vector<DaeFormulation> chosen;
  for (const double error : judged_errors) {
    const Candidate* const best = fastest_at(error, all, chosen);
    if (best != nullptr && std::ranges::find(chosen, best->formulation) == chosen.end())
      chosen.push_back(best->formulation);
  }
  if (!chosen.empty()) return chosen;
  return {std::ranges::max_element(all, {}, [](const Candidate& c) { return c.points.size(); })->formulation};
}

}  // namespace diracstep
