#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/runs/event_steps.hpp>
#include <diracstep/core/runs/run.hpp>
#include <diracstep/validation/references/published_cases.hpp>
#include <diracstep/validation/references/reference_run.hpp>

namespace diracstep {

namespace {

double value_in(const KnownState::Component& component, const Sample& end) {
  return (component.velocity ? end.v : end.q)[component.index];
}

std::string run_to_end(const CatalogueScene& entry, const Registry& registry, const SolverFactory& solvers,
                       double step, long steps, Sample& end) {
  const IntegratorOptions options{
      .method = entry.recommended.method, .order = entry.recommended.order, .step = step};
  try {
    EventSteps<Integrator> motion(entry.scene, entry.all_rows, entry.events, solvers, Momentum::projected,
                                  integrators(registry, solvers, options));
    return motion.run(steps, end).failure;
  } catch (const Misuse& misuse) {
    return misuse.what();
  }
}

}  // namespace

double relative_error(const KnownState& known, const Sample& end) {
  std::array<double, 2> differences{}, sizes{};
  for (const auto& component : known.components) {
    const std::size_t kind = component.velocity ? 1 : 0;
    differences[kind] = std::max(differences[kind], std::abs(value_in(component, end) - component.value));
    sizes[kind] = std::max(sizes[kind], std::abs(component.value));
  }
  double largest = 0.0;
  for (const std::size_t kind : {0, 1})
    if (!(differences[kind] <= 0.0))
      largest = std::max(largest, differences[kind] / std::max(sizes[kind], 1e-300));
  return largest;
}

std::vector<PublishedCase> run_published_cases(const CatalogueScene& entry, const Registry& registry,
                                               const SolverFactory& solvers) {
  const StepGrid grid = fit_steps(entry.scene->start.time, entry.recommended.end, entry.recommended.step);
  Sample end;
  PublishedCase common;
  common.scene = entry.scene->name;
  common.run = entry.recommended;
  common.run.step = grid.step;
  common.failure = run_to_end(entry, registry, solvers, grid.step, grid.steps, end);
  if (const auto point = entry.reference.at ? entry.reference.at(common.run.end) : std::nullopt;
      point && common.failure.empty())
    end = in_frames_of(point->q, end, entry.scene->space.get());
  std::vector<PublishedCase> cases;
  for (const KnownState& known : entry.known) {
    if (std::abs(known.t - common.run.end) > 1e-9 * std::max(1.0, std::abs(known.t))) continue;
    PublishedCase one = common;
    one.kind = known.kind;
    one.source = known.how;
    one.allowed = std::max(entry.recommended.tolerance, 3.0 * std::pow(10.0, -known.digits));
    if (one.failure.empty()) {
      const auto& first = known.components.front();
      one.component = first.name;
      one.published = first.value;
      one.computed = value_in(first, end);
      one.error = relative_error(known, end);
    }
    cases.push_back(std::move(one));
  }
  if (!cases.empty()) return cases;
  if (common.failure.empty()) common.failure = "no reference is stated at the recommended end";
  return {common};
}

}  // namespace diracstep
