/// What an error asked for costs: processor time of solve_to_error, its surveys, checks and all runs on the
/// way, over that of the best fixed step: among GL(3) to GL(6) and, on large scenes without rows, the
/// explicit compositions of the trapezoidal rule, the coarsest run whose true error at the end is below the
/// one asked for.  Both sides with the same solver and with the construction of their integrators; the best
/// step is chosen by hindsight and includes no estimate of its error.
///
///   error_search [SCENE…]      scenes of up to 15 coordinates and rows and toda_200 without any
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <diracstep/core/adaptive/error_control.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <diracstep/validation/studies/study_run.hpp>
#include <string>
#include <vector>

#include "fine_reference.hpp"
#include "timing.hpp"

namespace {

using namespace diracstep;

constexpr int decades[] = {3, 6, 9};

double fewest_seconds(const std::function<void()>& work) {
  const double once = fewest_nanoseconds({work}, 1, 1).front() * 1e-9;
  const int rounds = once > 0.3 ? 1 : once > 0.05 ? 3 : 7;
  return std::min(once, fewest_nanoseconds({work}, 1, rounds).front() * 1e-9);
}

/// The coarsest run of one method that meets an error, and its time.
struct BestRun {
  std::string method;
  long steps = 0;
  double seconds = HUGE_VAL;
};

double error_of(const CatalogueScene& scene, const Registry& registry, const IntegratorOptions& options,
                long steps, const ReferenceEnd& reference) {
  IntegratorOptions fitted = options;
  fitted.step = (scene.t_end - scene.scene->start.time) / static_cast<double>(steps);
  Integrator integrator(scene.scene, registry, kinsol(), fitted);
  Sample end;
  for (long k = 0; k < steps; ++k)
    if (!integrator.step().ok()) return HUGE_VAL;
  if (!integrator.sample(Momentum::projected, end).ok()) return HUGE_VAL;
  return reference.distance(end);
}

/// Improves `best` by the method, from coarse to fine; `steps` is where the search for the last error ended.
void try_method(const CatalogueScene& scene, const Registry& registry, const IntegratorOptions& options,
                double error, int order, const ReferenceEnd& reference, long& steps, BestRun& best) {
  const double limit = 3e6;
  double found = error_of(scene, registry, options, steps, reference);
  while (!(found <= error) && static_cast<double>(steps) < limit) {
    const double missing = std::isfinite(found) ? std::pow(found / error, 1.0 / order) : 2.0;
    steps = std::max(steps + 1, std::lround(static_cast<double>(steps) * std::clamp(missing, 1.05, 1.5)));
    found = error_of(scene, registry, options, steps, reference);
  }
  if (!(found <= error)) return;
  const double seconds = fewest_seconds([&] { error_of(scene, registry, options, steps, reference); });
  if (seconds < best.seconds)
    best = {options.method + (options.order ? " of order " + std::to_string(options.order) : ""), steps,
            seconds};
}

struct Ratios {
  std::vector<double> of_decade[std::size(decades)];
};

void examine(const std::string& name, Ratios& ratios) {
  const Registry registry = Registry::with_built_ins();
  const CatalogueScene scene = make_scene(name);
  const ReferenceEnd reference = fine_reference(scene, registry);
  std::vector<IntegratorOptions> methods;
  for (int s = 3; s <= 6; ++s) methods.push_back({.method = "type1/gl:" + std::to_string(s)});
  if (scene.scene->dimension() > 40 && scene.scene->rows() == 0)
    for (int order = 4; order <= 8; order += 2)
      methods.push_back({.method = "type1/trapezoidal", .order = order});
  const double span = scene.t_end - scene.scene->start.time;
  std::vector<long> steps(methods.size(), std::max(2L, std::lround(span / (8.0 * scene.natural_step))));
  for (std::size_t d = 0; d < std::size(decades); ++d) {
    const double error = std::pow(10.0, -decades[d]);
    if (error < reference.self_error) continue;  // nothing could be judged
    BestRun best;
    for (std::size_t i = 0; i < methods.size(); ++i) {
      const int order = methods[i].order ? methods[i].order : 2 * (static_cast<int>(i) + 3);
      try_method(scene, registry, methods[i], error, order, reference, steps[i], best);
    }
    ErrorControlReport report;
    const double seconds = fewest_seconds(
        [&] { report = solve_to_error(scene.scene, registry, kinsol(), scene.t_end, {.error = error}); });
    const double last = report.ok() ? fewest_seconds([&] {
      (void)run_again(scene.scene, registry, kinsol(), report, Momentum::projected, 1'000'000'000,
                      [](const Sample&) { return true; });
    })
                                    : std::nan("");
    const double ratio = seconds / best.seconds;
    if (report.ok() && std::isfinite(best.seconds)) ratios.of_decade[d].push_back(ratio);
    std::printf(
        "%-26s%.0e  best %-28s%7ld steps%9.3f ms; search%9.3f ms, last run%9.3f ms; ratio%6.1f; "
        "true error %.0e, estimate %.0e, %s%s%s, %zu runs of %ld solves, last %ld%s%s\n",
        name.c_str(), error, best.method.c_str(), best.steps, 1e3 * best.seconds, 1e3 * seconds, 1e3 * last,
        ratio, reference.distance(report.end), report.estimate, report.method.c_str(),
        report.adaptive ? " variable" : "", report.compensated_sums ? " compensated" : "", report.runs.size(),
        report.work.solves, report.runs.empty() ? 0 : report.runs.back().solves, report.ok() ? "" : "; ",
        report.refusal.c_str());
    std::fflush(stdout);
  }
}

}  // namespace

int main(int count, char** arguments) {
  std::vector<std::string> names(arguments + 1, arguments + count);
  if (names.empty()) {
    for (const std::string& name : scene_names()) {
      const CatalogueScene entry = make_scene(name);
      if (entry.needs.empty() && entry.scene->dimension() + entry.scene->rows() <= 15) names.push_back(name);
    }
    names.emplace_back("toda_200");
  }
  Ratios ratios;
  for (const std::string& name : names) examine(name, ratios);
  std::printf("\nsearch over best fixed step:\n");
  for (std::size_t d = 0; d < std::size(decades); ++d) {
    std::vector<double>& all = ratios.of_decade[d];
    if (all.empty()) continue;
    std::sort(all.begin(), all.end());
    std::printf("  1e-%d: median %.1f, worst %.1f of %zu scenes\n", decades[d], all[all.size() / 2],
                all.back(), all.size());
  }
  return 0;
}
