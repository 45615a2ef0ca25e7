/// How far solve_to_error keeps its word: over scenes of the catalogue and errors from 1e-3 to 1e-11, the
/// true error beside the one asked for and the one estimated.
///
///   error_control [SCENE…]      all scenes of up to 15 coordinates and rows without any
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

struct Tally {
  int runs = 0, refused = 0, met = 0, far_off = 0, warned = 0;
};

void examine(const std::string& name, Tally& tally) {
  const Registry registry = Registry::with_built_ins();
  const CatalogueScene scene = make_scene(name);
  const ReferenceEnd reference = fine_reference(scene, registry);
  std::printf("\n%s, t = %g; reference %s, known to %.0e\n", name.c_str(), scene.t_end,
              reference.kind.c_str(), reference.self_error);
  for (int k = 3; k <= 11; ++k) {
    const double error = std::pow(10.0, -k);
    if (error < reference.self_error) continue;  // nothing could be judged
    const double start = processor_seconds();
    const ErrorControlReport report =
        solve_to_error(scene.scene, registry, kinsol(), scene.t_end, {.error = error});
    const double seconds = processor_seconds() - start, found = reference.distance(report.end);
    const auto last = report.runs.back().solves;
    ++tally.runs;
    if (!report.ok())
      ++tally.refused;
    else if (found <= error)
      ++tally.met;
    if (report.ok() && found > 5.0 * error && report.warning.empty()) ++tally.far_off;
    if (!report.warning.empty()) ++tally.warned;
    std::printf(
        "  %.0e: true %.1e, estimate %.1e, order %4.1f, %s %s, %zu runs, work %.2f of the last, %.0f "
        "ms%s%s%s%s%s\n",
        error, found, report.estimate, report.observed_order, report.method.c_str(),
        report.adaptive ? "variable" : "fixed", report.runs.size(),
        static_cast<double>(report.work.solves) / static_cast<double>(last), 1e3 * seconds,
        report.ok() && found > error ? "  MISSED" : "", report.ok() ? "" : "; ", report.refusal.c_str(),
        report.warning.empty() ? "" : "; warning: ", report.warning.c_str());
    std::fflush(stdout);
  }
}

}  // namespace

int main(int count, char** arguments) {
  std::vector<std::string> names(arguments + 1, arguments + count);
  if (names.empty())
    for (const std::string& name : scene_names()) {
      const CatalogueScene entry = make_scene(name);
      if (entry.needs.empty() && entry.scene->dimension() + entry.scene->rows() <= 15) names.push_back(name);
    }
  Tally tally;
  for (const std::string& name : names) examine(name, tally);
  const int accepted = tally.runs - tally.refused;
  std::printf(
      "\n%d runs, %d refused; of %d accepted %d met the error (%.1f %%), %d were above 5 times it without a "
      "warning; %d warnings\n",
      tally.runs, tally.refused, accepted, tally.met, 100.0 * tally.met / std::max(accepted, 1),
      tally.far_off, tally.warned);
  return 0;
}
