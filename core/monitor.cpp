#include <algorithm>
#include <array>
#include <cmath>
#include <diracstep/core/errors.hpp>
#include <diracstep/core/monitor.hpp>
#include <sstream>
#include <utility>
#include <vector>

namespace diracstep {

namespace {

/// Half the width of a difference, in steps.
constexpr double difference_width = 1e-3;

Vector probing_velocity(const Vector& v) {
  const double size = v.size() > 0 && v.lpNorm<Eigen::Infinity>() > 0.0 ? v.lpNorm<Eigen::Infinity>() : 1.0;
  Vector probe = v;
  for (Eigen::Index i = 0; i < v.size(); ++i)
    probe[i] += size * (i % 2 == 0 ? 0.7 : -0.4) * (1.0 + 0.1 * static_cast<double>(i));
  return probe;
}

}  // namespace

void require_even(const Monitor& monitor, const Start& start) {
  if (!monitor.rate) return;
  const double at_start = monitor.rate(start.time, start.q, start.v);
  std::ostringstream message;
  message.precision(12);
  if (!(at_start > 0.0) || !std::isfinite(at_start)) {
    message << "the monitor is " << at_start << " at the start; it must be positive and finite";
    throw Misuse(message.str());
  }
  for (const Vector& v : {start.v, probing_velocity(start.v)}) {
    const double there = monitor.rate(start.time, start.q, v), back = monitor.rate(start.time, start.q, -v);
    if (!std::isfinite(there) || std::abs(there - back) <= 1e-12 * std::abs(there)) continue;
    message << "the monitor is not even in the velocity: it is " << there << " at v and " << back
            << " at -v, for v = (" << v.transpose() << "); steps chosen by it are not reversible";
    throw Misuse(message.str());
  }
}

PointwiseMotion::PointwiseMotion(const Scene& scene, const SolverFactory& solvers, int dense_limit)
    : dense_(scene.dimension() + scene.rows() <= dense_limit),
      n_(scene.dimension()),
      velocity_problem_(scene, dense_),
      acceleration_problem_(scene, dense_),
      factors_(dense_ ? n_ + scene.rows() : 0) {
  if (scene.lagrangian->structure().y_hessian_zero)
    throw Misuse(
        "scene '" + scene.name +
        "': its Lagrangian is linear in v, so there are no accelerations to choose variable steps by; use a "
        "fixed step");
  velocity_solver_ = solvers(velocity_problem_);
  const int size = acceleration_problem_.size();
  if (dense_)
    matrix_.setZero(size, size);
  else
    acceleration_solver_ = solvers(acceleration_problem_);
  velocity_unknowns_.setZero(size);
  unknowns_.setZero(size);
  right_hand_side_.setZero(size);
}

SolveReport PointwiseMotion::velocity(double t, ConstVectorRef q, ConstVectorRef p, Vector& v) {
  velocity_problem_.begin(t, q, p);
  velocity_solver_->reset();
  velocity_unknowns_.setZero();
  velocity_unknowns_.head(n_) = v;
  SolveReport report = velocity_solver_->solve(velocity_unknowns_);
  v = velocity_unknowns_.head(n_);
  return report;
}

SolveReport PointwiseMotion::acceleration(double t, ConstVectorRef q, ConstVectorRef v, VectorRef a) {
  ++accelerations_;
  acceleration_problem_.begin(t, q, v);
  unknowns_.setZero();
  SolveReport report;
  if (dense_) {
    acceleration_problem_.residual(unknowns_, right_hand_side_);
    acceleration_problem_.jacobian(unknowns_, matrix_.reshaped());
    factors_.compute(matrix_);
    unknowns_ = factors_.solve(-right_hand_side_);
    if (!unknowns_.allFinite()) report.status = SolveStatus::singular_jacobian;
  } else {
    acceleration_solver_->reset();
    report = acceleration_solver_->solve(unknowns_);
  }
  a = unknowns_.head(n_);
  return report;
}

PaceMeter::PaceMeter(const Scene& scene, const SolverFactory& solvers, Monitor monitor, MonitorScales scales)
    : monitor_(std::move(monitor)), scales_(scales), a_(Columns::Zero(scene.dimension(), 5)) {
  q_.setZero(scene.dimension());
  v_ = q_;
  motion_ = std::make_unique<PointwiseMotion>(scene, solvers);
}

bool PaceMeter::accelerations(double t, ConstVectorRef q, ConstVectorRef v, double delta, int reach) {
  last_ = motion_->acceleration(t, q, v, a_.col(2));
  for (const int place : {1, 3, 0, 4}) {
    if (std::abs(place - 2) > reach || !last_.ok()) continue;
    const double tau = (place - 2) * delta;
    q_ = q + tau * v + (0.5 * tau * tau) * a_.col(2);
    v_ = v + tau * a_.col(2);
    last_ = motion_->acceleration(t + tau, q_, v_, a_.col(place));
  }
  return last_.ok();
}

double PaceMeter::generic_rate(int place, ConstVectorRef v, double delta) const {
  const double tau = (place - 2) * delta, typical = scales_.typical * scales_.typical;
  const double v2 = (v + tau * a_.col(2)).squaredNorm(), a2 = a_.col(place).squaredNorm();
  const double jerk2 = (a_.col(place + 1) - a_.col(place - 1)).squaredNorm() / (4.0 * delta * delta);
  const double floor = scales_.lowest * scales_.lowest, below = typical * v2 + a2;
  return std::sqrt((below > 0.0 ? (typical * a2 + jerk2) / below : 0.0) + floor);
}

double PaceMeter::own_rate(double t, ConstVectorRef q, ConstVectorRef v, double delta, int place) {
  const double tau = (place - 2) * delta;
  q_ = q + tau * v;
  v_ = v;
  if (monitor_.depends_on_velocity) {
    q_ += (0.5 * tau * tau) * a_.col(2);
    v_ += tau * a_.col(2);
  }
  return monitor_.rate(t + tau, q_, v_);
}

Pace PaceMeter::failed() const {
  return {0.0, 0.0, std::string("no acceleration for the monitor: ") + describe(last_.status)};
}

Pace PaceMeter::rate(double t, ConstVectorRef q, ConstVectorRef v, double step) {
  const double delta = difference_width * std::abs(step);
  if (generic() && !accelerations(t, q, v, delta, 1)) return failed();
  Pace pace;
  pace.rate = generic() ? generic_rate(2, v, delta) : monitor_.rate(t, q, v);
  if (!(pace.rate > 0.0) || !std::isfinite(pace.rate))
    pace.failure = "the monitor is " + std::to_string(pace.rate) + "; it must be positive and finite";
  return pace;
}

Pace PaceMeter::rate_and_growth(double t, ConstVectorRef q, ConstVectorRef v, double step) {
  const double delta = difference_width * std::abs(step);
  double before = 0.0, after = 0.0;
  Pace pace;
  if (generic()) {
    if (!accelerations(t, q, v, delta, 2)) return failed();
    before = generic_rate(1, v, delta);
    pace.rate = generic_rate(2, v, delta);
    after = generic_rate(3, v, delta);
  } else {
    if (monitor_.depends_on_velocity && !accelerations(t, q, v, delta, 0)) return failed();
    before = own_rate(t, q, v, delta, 1);
    pace.rate = monitor_.rate(t, q, v);
    after = own_rate(t, q, v, delta, 3);
  }
  pace.growth = std::log(after / before) / (2.0 * delta);
  if (!(pace.rate > 0.0) || !std::isfinite(pace.rate) || !std::isfinite(pace.growth)) {
    std::ostringstream message;
    message << "the monitor is " << pace.rate << " at t = " << t << ", around it " << before << " and "
            << after << "; it must be positive and finite";
    pace.failure = message.str();
  }
  return pace;
}

namespace {

/// A quantity over time, for its median.
class TimeSeries {
 public:
  void add(double value, double duration) {
    if (std::isfinite(value)) values_.emplace_back(value, duration);
  }
  double median() {
    std::ranges::sort(values_);
    double all = 0.0, sum = 0.0;
    for (const auto& [value, duration] : values_) all += duration;
    for (const auto& [value, duration] : values_)
      if ((sum += duration) >= 0.5 * all) return value;
    return 0.0;
  }
  double lowest() const { return values_.empty() ? 0.0 : std::ranges::min(values_).first; }
  double highest() const { return values_.empty() ? 0.0 : std::ranges::max(values_).first; }

 private:
  std::vector<std::pair<double, double>> values_;
};

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
    for (Vector& k : a_) k.setZero(q_.size());
    next_ = a_[0];
  }

  std::string go(long most_steps) {
    const double span = std::abs(end_ - t_), sign = end_ > t_ ? 1.0 : -1.0, start = t_;
    if (!motion_.acceleration(t_, q_, v_, a_[0]).ok()) return "no acceleration at the start";
    double h = first_step(span);
    for (long k = 0; k < most_steps && std::abs(end_ - t_) > 1e-12 * span; ++k) {
      h = std::min(h, std::abs(end_ - t_));
      Vector q, v;
      if (!runge_kutta(sign * h, q, v) || !motion_.acceleration(t_ + sign * h, q, v, next_).ok() ||
          !next_.allFinite())
        return "the coarse run failed";
      const double rate = rate_between(v, h);
      if (h * rate > 0.9 && h > 1e-12 * span) {  // too coarse: once more, shorter
        h *= std::max(0.1, 0.3 / (h * rate));
        continue;
      }
      pace.add(rate, h);
      ratio.add(v.norm() > 0.0 ? next_.norm() / v.norm() : HUGE_VAL, h);
      t_ += sign * h;
      q_.swap(q);
      v_.swap(v);
      a_[0].swap(next_);
      covered = std::abs(t_ - start);
      h *= rate > 0.0 ? std::clamp(0.3 / (h * rate), 0.2, 1.5) : 1.5;
    }
    return {};
  }

  TimeSeries pace, ratio;
  double covered = 0.0;

 private:
  double first_step(double span) const {
    const double a = a_[0].norm(), v = v_.norm();
    const double by_rate = v > 0.0 && a > 0.0 ? 0.1 * v / a : span;
    return std::min({1e-3 * span, by_rate});
  }

  /// ω halfway: with mean squares of v and a, and ȧ from their difference.
  double rate_between(const Vector& v, double h) const {
    const double w2 = typical_ * typical_;
    const double v2 = 0.5 * (v_.squaredNorm() + v.squaredNorm());
    const double a2 = 0.5 * (a_[0].squaredNorm() + next_.squaredNorm());
    const double jerk2 = (next_ - a_[0]).squaredNorm() / (h * h), below = w2 * v2 + a2;
    return below > 0.0 ? std::sqrt((w2 * a2 + jerk2) / below) : 0.0;
  }

  bool runge_kutta(double h, Vector& q, Vector& v) {
    const Vector v2 = v_ + 0.5 * h * a_[0];
    if (!motion_.acceleration(t_ + 0.5 * h, q_ + 0.5 * h * v_, v2, a_[1]).ok()) return false;
    const Vector v3 = v_ + 0.5 * h * a_[1];
    if (!motion_.acceleration(t_ + 0.5 * h, q_ + 0.5 * h * v2, v3, a_[2]).ok()) return false;
    const Vector v4 = v_ + h * a_[2];
    if (!motion_.acceleration(t_ + h, q_ + h * v3, v4, a_[3]).ok()) return false;
    q = q_ + h / 6.0 * (v_ + 2.0 * v2 + 2.0 * v3 + v4);
    v = v_ + h / 6.0 * (a_[0] + 2.0 * a_[1] + 2.0 * a_[2] + a_[3]);
    return q.allFinite() && v.allFinite();
  }

  PointwiseMotion& motion_;
  double t_, end_, typical_;
  Vector q_, v_, next_;
  std::array<Vector, 4> a_;
};

}  // namespace

PaceSurvey survey_pace(const Scene& scene, const SolverFactory& solvers, double end, long most_steps) {
  PointwiseMotion motion(scene, solvers);
  const double span = std::abs(end - scene.start.time);
  if (!(span > 0.0) || !std::isfinite(span))
    throw Misuse("survey of the pace: the end is the start or not finite");
  // ω0 is not known beforehand; a first pass by |ȧ|/|a| alone, with ω0 = 0, finds it.
  SurveyRun first(motion, scene, end, 0.0);
  PaceSurvey survey;
  survey.failure = first.go(most_steps / 2);
  survey.scales.typical = first.ratio.median();
  SurveyRun second(motion, scene, end, survey.scales.typical);
  survey.failure = second.go(most_steps - most_steps / 2);
  survey.slowest = second.pace.lowest();
  survey.fastest = second.pace.highest();
  survey.covered = second.covered;
  survey.scales.lowest = std::max(0.3 * second.pace.median(), 0.3 / span);
  survey.accelerations = motion.accelerations();
  return survey;
}

}  // namespace diracstep
