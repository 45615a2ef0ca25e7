#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <diracstep/core/adaptive/pointwise_motion.hpp>
#include <diracstep/core/adaptive/rate_survey.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/core/spaces/space.hpp>
#include <vector>

namespace diracstep {

namespace {

constexpr double short_part = 1e-3;     // of the span: a survey of less says little of the motion
constexpr double largest_power = 20.0;  // of the time, by which ω is taken to fall like m/(t − t0)
constexpr long longer_survey = 8;       // times the steps, once, where ω falls so
constexpr double most_of_fixed = 20.0;  // times the fixed steps that variable ones may take
constexpr long most_steps = 5000;       // of a survey that is made longer
constexpr double no_typical = -1.0;     // in place of ω0

/// The motion over one step of the survey: mean squares of v and a, and of ȧ from their difference.
struct SurveyStep {
  double duration, v2, a2, jerk2;

  /// Without a typical rate ω0: |ȧ|/|a|, and where the acceleration passes through zero, as that of a
  /// pendulum at its lowest point, sqrt(|ȧ|/|v|).
  double rate_alone() const {
    const double by_a = a2 > 0.0 ? std::sqrt(jerk2 / a2) : HUGE_VAL;
    const double by_v = v2 > 0.0 ? std::pow(jerk2 / v2, 0.25) : HUGE_VAL;
    const double least = std::min(by_a, by_v);
    return least < HUGE_VAL ? least : 0.0;
  }

  double rate(double typical) const {
    if (typical == no_typical) return rate_alone();
    const double w2 = typical * typical, below = w2 * v2 + a2;
    return below > 0.0 ? std::sqrt((w2 * a2 + jerk2) / below) : 0.0;
  }
};

/// The median over time of a quantity.
template <class Quantity>
double median(const std::vector<SurveyStep>& stretches, Quantity quantity) {
  std::vector<std::pair<double, double>> values;
  double all = 0.0, sum = 0.0;
  for (const SurveyStep& stretch : stretches) {
    values.emplace_back(quantity(stretch), stretch.duration);
    all += stretch.duration;
  }
  std::ranges::sort(values);
  for (const auto& [value, duration] : values)
    if ((sum += duration) >= 0.5 * all) return value;
  return 0.0;
}

double fastest_rate(const std::vector<SurveyStep>& stretches, double typical) {
  double fastest = 0.0;
  for (const SurveyStep& stretch : stretches) fastest = std::max(fastest, stretch.rate(typical));
  return fastest;
}

/// Whether ω only fell, by far, in a time that is short beside the motion, as after a start at rest: then
/// what was surveyed says nothing of the rest.
bool only_fell(const std::vector<SurveyStep>& stretches, double typical, double covered, double span) {
  return covered < short_part * span && !stretches.empty() &&
         stretches.back().rate(typical) < 1e-2 * fastest_rate(stretches, typical);
}

/// Whether ω still falls like m/(t − t0) in a time that is short beside the motion, as it does after a start
/// at rest under a force like (t − t0)^m: each step then lengthens that time by one factor, and with more
/// steps the survey gets through.
bool falls_like_time(const std::vector<SurveyStep>& stretches, double typical, double covered, double span) {
  if (stretches.empty() || covered >= short_part * span) return false;
  const double last = stretches.back().rate(typical);
  return last < 0.5 * fastest_rate(stretches, typical) && last * covered < largest_power;
}

double lowest_rate(const std::vector<SurveyStep>& stretches, double typical) {
  return 0.3 * median(stretches, [typical](const SurveyStep& s) { return s.rate(typical); });
}

/// One pass of the survey, with the steps that ω at a given ω0 asks for.
class SurveyRun {
 public:
  SurveyRun(PointwiseMotion& motion, const Scene& scene, double end, double typical)
      : motion_(motion),
        t_(scene.start.time),
        end_(end),
        typical_(typical),
        q_(scene.start.q),
        v_(scene.start.v) {
    for (Vector& k : a_) k.setZero(v_.size());
    next_ = a_[0];
  }

  /// Empty, or why it stopped.
  std::string go(long max_steps) {
    const double span = std::abs(end_ - t_), start = t_;
    if (!motion_.acceleration(t_, q_, v_, a_[0]).ok()) return "no acceleration at the start";
    double h = first_step(span);
    for (long k = 0; k < max_steps && std::abs(end_ - t_) > 1e-12 * span; ++k) {
      h = std::min(h, std::abs(end_ - t_));
      if (!runge_kutta(std::copysign(h, end_ - t_))) return "the coarse run failed";
      const SurveyStep stretch = stretch_to_next(h);
      const double rate = stretch.rate(typical_);
      if (h * rate > 0.9 && h > 1e-12 * span) {  // too coarse: once more, shorter
        h *= std::max(0.1, 0.3 / (h * rate));
        continue;
      }
      stretches.push_back(stretch);
      advance(h);
      covered = std::abs(t_ - start);
      h *= rate > 0.0 ? std::clamp(0.3 / (h * rate), 0.2, 1.5) : 1.5;
    }
    return {};
  }

  std::vector<SurveyStep> stretches;
  double covered = 0.0;

 private:
  double first_step(double span) const {
    const double a = a_[0].norm(), v = v_.norm();
    return std::min(1e-3 * span, v > 0.0 && a > 0.0 ? 0.1 * v / a : span);
  }

  SurveyStep stretch_to_next(double h) const {
    return {h, 0.5 * (v_.squaredNorm() + next_v_.squaredNorm()),
            0.5 * (a_[0].squaredNorm() + next_.squaredNorm()), (next_ - a_[0]).squaredNorm() / (h * h)};
  }

  Vector ahead(ConstVectorRef x) const { return moved(motion_.space(), q_, x); }

  void advance(double h) {
    t_ += std::copysign(h, end_ - t_);
    q_.swap(next_q_);
    v_.swap(next_v_);
    a_[0].swap(next_);
  }

  /// From (q, v, a) to (next_q, next_v, next).
  bool runge_kutta(double h) {
    const Vector v2 = v_ + 0.5 * h * a_[0];
    if (!motion_.acceleration(t_ + 0.5 * h, ahead(0.5 * h * v_), v2, a_[1]).ok()) return false;
    const Vector v3 = v_ + 0.5 * h * a_[1];
    if (!motion_.acceleration(t_ + 0.5 * h, ahead(0.5 * h * v2), v3, a_[2]).ok()) return false;
    const Vector v4 = v_ + h * a_[2];
    if (!motion_.acceleration(t_ + h, ahead(h * v3), v4, a_[3]).ok()) return false;
    next_q_ = ahead(h / 6.0 * (v_ + 2.0 * v2 + 2.0 * v3 + v4));
    next_v_ = v_ + h / 6.0 * (a_[0] + 2.0 * a_[1] + 2.0 * a_[2] + a_[3]);
    return motion_.acceleration(t_ + h, next_q_, next_v_, next_).ok() && next_q_.allFinite() &&
           next_v_.allFinite() && next_.allFinite();
  }

  PointwiseMotion& motion_;
  double t_, end_, typical_;
  Vector q_, v_, next_q_, next_v_, next_;
  std::array<Vector, 4> a_;  ///< accelerations at the stages
};

}  // namespace

RateSurvey survey_rate(const Scene& scene, const SolverFactory& solvers, double end, long max_steps) {
  PointwiseMotion motion(scene, solvers);
  const double span = std::abs(end - scene.start.time);
  if (!(span > 0.0) || !std::isfinite(span))
    throw Misuse("survey of the rate: the end is the start or not finite");
  RateSurvey survey;
  // ω0 is not known beforehand; a first pass by |ȧ|/|a| alone, with ω0 = 0, finds it.
  SurveyRun first(motion, scene, end, 0.0);
  survey.failure = first.go(max_steps / 2);
  const auto a_over_v = [](const SurveyStep& s) { return s.v2 > 0.0 ? std::sqrt(s.a2 / s.v2) : 0.0; };
  double typical = median(first.stretches, a_over_v);
  if (first.covered <
      short_part * span) {  // an acceleration of zero at the start: |ȧ|/|a| has no bound there
    SurveyRun other(motion, scene, end, no_typical);
    if (other.go(max_steps / 2).empty() && other.covered > first.covered)
      typical = median(other.stretches, a_over_v);
  }
  SurveyRun second(motion, scene, end, typical);
  survey.failure = second.go(max_steps - max_steps / 2);
  if (longer_survey * max_steps <= most_steps && survey.failure.empty() &&
      falls_like_time(second.stretches, typical, second.covered, span))
    return survey_rate(scene, solvers, end, longer_survey * max_steps);
  survey.scales.typical = typical;
  const bool fell = only_fell(second.stretches, typical, second.covered, span);
  survey.scales.lowest = std::max(fell ? 0.0 : lowest_rate(second.stretches, typical), 0.3 / span);
  survey.covered = second.covered;
  survey.accelerations = motion.accelerations();
  for (const SurveyStep& stretch : second.stretches) {
    const double rate = stretch.rate(survey.scales.typical);
    survey.slowest = survey.slowest == 0.0 ? rate : std::min(survey.slowest, rate);
    survey.fastest = std::max(survey.fastest, rate);
  }
  return survey;
}

PlanLine variable_steps_line(const std::shared_ptr<const Scene>& given, const SolverFactory& solvers,
                             double end, double step, const std::string& how) {
  const auto scene = completed(given);
  if (!has_accelerations(*scene))
    return {"variable steps", "not offered",
            why_no_accelerations(*scene) + ": no accelerations to choose them by"};
  const RateSurvey survey = survey_rate(*scene, solvers, end);
  if (!survey.failure.empty()) return {"variable steps", "not known", survey.failure};
  const double span = std::abs(end - scene->start.time);
  const std::string reason = "max ω / min ω = " + to_text(survey.ratio(), 2) + " over the first " +
                             to_text(survey.covered, 3) + " of " + to_text(span, 3) + " units of time";
  // The survey takes four accelerations a step, and larger steps than a run.
  const double wanted = 1.5 * static_cast<double>(survey.accelerations) / 4.0 * span / survey.covered;
  const double fixed = span / std::abs(step);
  if (wanted > most_of_fixed * fixed)
    return {"variable steps", "left out",
            "they would take about " + to_text(wanted, 1) + " steps, " + to_text(fixed, 1) +
                " of the scene's own size lead to the end; " + reason};
  if (survey.variable_steps_pay()) return {"variable steps", "save time: " + how, reason};
  return {"variable steps", "left out", reason + ", they save time above 5"};
}

}  // namespace diracstep
