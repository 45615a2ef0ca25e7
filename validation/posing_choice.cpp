#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/validation/ida_reference.hpp>
#include <diracstep/validation/posing_choice.hpp>
#include <diracstep/validation/work_precision.hpp>
#include <limits>

namespace diracstep {

namespace {

constexpr std::array<double, 3> judged_errors{1e-3, 1e-6, 1e-9};

struct Candidate {
  Posing posing;
  std::vector<WorkPoint> points;  ///< of the runs that completed
};

Candidate tried(Posing posing, const Scene& scene, double t_end, const std::vector<double>& rtols,
                const Truth& truth, double budget, const Look& look) {
  Candidate candidate{posing, {}};
  for (const double rtol : rtols) {
    if (look) look();
    const ReferenceRun run = integrate_with_ida(scene, t_end, {.rtol = rtol, .posing = posing});
    if (run.ok()) candidate.points.push_back({rtol, truth.distance(run.end), run.cpu_seconds});
    if (run.cpu_seconds > budget) break;
  }
  return candidate;
}

/// The mean logarithm of the time at those errors that all reach; infinite where there are none.
double mean_time(const Candidate& candidate, const std::vector<Candidate>& all) {
  double sum = 0.0;
  int count = 0;
  for (const double error : judged_errors) {
    if (!std::ranges::all_of(all,
                             [&](const Candidate& c) { return cpu_seconds_at(c.points, error).has_value(); }))
      continue;
    sum += std::log(*cpu_seconds_at(candidate.points, error));
    ++count;
  }
  return count > 0 ? sum / count : std::numeric_limits<double>::infinity();
}

}  // namespace

Posing fastest_posing(const Scene& scene, double t_end, const std::vector<double>& rtols, const Truth& truth,
                      double budget, const Look& look) {
  const std::vector<Posing> posings = posings_of(scene);
  if (posings.size() == 1 || rtols.empty()) return Posing::rates;
  std::vector<Candidate> all;
  for (const Posing posing : posings) all.push_back(tried(posing, scene, t_end, rtols, truth, budget, look));
  std::size_t most = 0;
  for (const Candidate& candidate : all) most = std::max(most, candidate.points.size());
  std::erase_if(all, [&](const Candidate& candidate) { return candidate.points.size() < most; });
  // the first of equals: `rates`, if it is still among them
  return std::ranges::min_element(all, {}, [&](const Candidate& c) { return mean_time(c, all); })->posing;
}

}  // namespace diracstep
