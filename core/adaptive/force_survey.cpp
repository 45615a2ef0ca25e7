#include <algorithm>
#include <cmath>
#include <diracstep/core/adaptive/force_survey.hpp>

namespace diracstep {

namespace {

constexpr long points_of_smooth = 2'000, all_points = 20'000, fewest_points = 2'000;
constexpr long most_parts = 3'000, most_readings = 2'000'000;  // the latter of a small scene
constexpr int looks_for_kinks = 16;                            // in a step
constexpr double widest_gap = 32.0;                            // in closest times, at a jump

}  // namespace

ForceSurvey::ForceSurvey(const Scene& scene, double error)
    : kinks_(scene.kinks), size_(scene.dimension() + scene.rows()), force_(scene, error) {}

/// Where in (a, b) the scene's formulas show that F may change fast, in the order of the motion.
std::vector<KinkCrossing> ForceSurvey::known_in(const PathCubic& path, double a, double b) {
  return crossings_->along(path, a, b, looks_for_kinks, 0.25 * force_.closest(b));
}

/// The smallest part of (a, b) that bisection leads to whose polynomial misses F while those of both its
/// halves do not; a few units of round-off wide where F jumps.
std::pair<double, double> ForceSurvey::narrow(const PathCubic& path, double a, double b) {
  while (std::abs(b - a) > force_.closest(b)) {
    const double middle = 0.5 * (a + b);
    const double left = force_.fit(path, a, middle, 8, {}), right = force_.fit(path, middle, b, 8, {});
    if (left <= 1.0 && right <= 1.0) break;
    (left > right ? b : a) = middle;
  }
  return {a, b};
}

/// A stretch that the last polynomial is of.
void ForceSurvey::add(const Stretch& stretch, const PathCubic& path, ForceSurveyReport& report) {
  report.stretches.push_back(stretch);
  force_.count_rounding(path);
}

/// Divides (a, b), whose polynomial misses F, into parts that do not.
void ForceSurvey::divide(const PathCubic& path, double a, double b, const std::vector<KinkCrossing>& known,
                         ForceSurveyReport& report) {
  std::vector<std::pair<double, double>> cuts;  // ends of parts, and beginnings of those that follow
  for (const KinkCrossing& crossing : known) {
    const double t = crossing.time, beside = std::copysign(force_.closest(t), b - a);
    // What is left out of a narrow pulse would be missed of its impulse.
    const double gap = crossing.smooth ? 0.0 : beside;
    if ((t - a) / beside > 2.0 && (b - t) / beside > 2.0) cuts.emplace_back(t - gap, t + gap);
  }
  if (cuts.empty()) {
    const auto [low, high] = narrow(path, a, b);
    const double middle = 0.5 * (low + high), width = std::abs(high - low);
    if (width <= widest_gap * force_.closest(b))
      cuts.emplace_back(low, high);
    else if (width < std::abs(b - a) / 64.0)
      cuts.emplace_back(middle, middle);
    else
      cuts.emplace_back(0.5 * (a + b), 0.5 * (a + b));
  }
  double from = a;
  cuts.emplace_back(b, b);
  for (const auto& [to, next] : cuts) {
    const double part_from = from;
    from = next;
    if (!((to - part_from) * (b - a) > 0.0)) continue;
    if (++parts_ > most_parts || force_.readings() > most_readings / std::max(1L, size_ / 16)) {
      report.followed = false;
      return;
    }
    const long points = std::max(
        8L, static_cast<long>(static_cast<double>(points_) * std::abs(to - part_from) / force_.span()));
    const double part = force_.fit(path, part_from, to, points, {});
    if (part > 1.0 && std::abs(to - part_from) > widest_gap * force_.closest(to))
      divide(path, part_from, to, {}, report);
    else
      add({part_from, to}, path, report);
    if (!report.followed) return;
  }
}

/// Adds what the polynomial of (a, b) misses of F in its parts: the integral of the difference in each.
void ForceSurvey::count_missed(const PathCubic& path, double a, double b, std::size_t first,
                               ForceSurveyReport& report) {
  force_.fit(path, a, b, 0, {});
  double missed = 0.0, most = 0.0, time = a;
  for (std::size_t k = first; k < report.stretches.size(); ++k) {
    const double from = report.stretches[k].begin, to = report.stretches[k].end;
    double here = 0.0;
    for (const GaussPoint& point : gauss_points)
      here += point.weight * force_.miss(path, from + point.place * (to - from)) * std::abs(to - from);
    missed += here;
    if (here > most) {
      most = here;
      time = 0.5 * (from + to);
    }
  }
  if (!report.followed) missed = HUGE_VAL;
  if (most > most_missed_) {
    most_missed_ = most;
    report.time = time;
  }
  report.missed += missed;
}

/// Whether the node between two steps lies at a kink that the motion crosses.
bool ForceSurvey::switches_at(const PathCubic& before, const PathCubic& after) {
  if (!kinks_ || kinks_->count() == 0) return false;
  const double gap = std::copysign(force_.closest(before.end()), before.end() - before.begin());
  Vector q, v, here(kinks_->count()), there(here);
  before.at(before.end() - gap, q, v);
  kinks_->evaluate(before.end() - gap, q, v, here);
  after.at(after.begin() + gap, q, v);
  kinks_->evaluate(after.begin() + gap, q, v, there);
  return (here.array() * there.array() < 0.0).any();
}

void ForceSurvey::examine(const PathCubic& path, double a, double b, ForceSurveyReport& report) {
  const std::vector<KinkCrossing> known = known_in(path, a, b);
  std::vector<double> times;
  for (const KinkCrossing& crossing : known) times.push_back(crossing.time);
  const auto share = static_cast<double>(points_) * std::abs(b - a) / force_.span();
  if (force_.fit(path, a, b, std::max(4L, static_cast<long>(share)), times) <= 1.0) {
    if (whole_) {
      report.stretches.back().end = b;
      force_.count_rounding(path);
    } else {
      add({a, b}, path, report);
    }
    whole_ = true;
    return;
  }
  const std::size_t first = report.stretches.size();
  whole_ = false;
  divide(path, a, b, known, report);
  count_missed(path, a, b, first, report);
}

ForceSurveyReport ForceSurvey::along(const std::vector<PathPoint>& path, long parts) {
  ForceSurveyReport report;
  const double start = path.front().time, end = path.back().time;
  points_ =
      force_.smooth() ? points_of_smooth : std::max(fewest_points, all_points / std::max(1L, size_ / 4));
  parts_ = 0;
  most_missed_ = 0.0;
  whole_ = false;
  crossings_.emplace(kinks_, start, end);
  force_.find_scales(path);
  double gap = 0.0;  // at the beginning of the next step
  for (std::size_t k = 0; k + 1 < path.size() && report.followed; ++k) {
    const PathCubic cubic{path[k], path[k + 1]};
    const double a = cubic.begin(), b = cubic.end();
    if (std::abs(b - a) <= (2.0 + widest_gap) * force_.closest(b)) {
      whole_ = false;
      continue;
    }
    const std::size_t first = report.stretches.size();
    for (long part = 0; part < parts && report.followed; ++part) {
      const double from = static_cast<double>(part) / static_cast<double>(parts),
                   to = static_cast<double>(part + 1) / static_cast<double>(parts);
      examine(cubic, part == 0 ? a : a + from * (b - a), part + 1 == parts ? b : a + to * (b - a), report);
    }
    if (gap != 0.0 && first < report.stretches.size()) report.stretches[first].begin += gap;
    gap = 0.0;
    if (!report.followed || k + 2 >= path.size()) continue;
    const PathCubic next{path[k + 1], path[k + 2]};
    if (std::abs(next.end() - b) <= (2.0 + widest_gap) * force_.closest(b) || !force_.jumps(cubic, next))
      continue;
    gap = std::copysign(force_.closest(b), b - a);
    report.stretches.back().end -= gap;
    whole_ = false;
    if (switches_at(cubic, next)) continue;  // every run has a node there: StepDivision
    report.missed = HUGE_VAL;
    report.time = b;
  }
  report.rounding = force_.rounding();
  return report;
}

}  // namespace diracstep
