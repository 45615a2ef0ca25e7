#include <algorithm>
#include <cmath>
#include <diracstep/core/adaptive/kink_steps.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <limits>

namespace diracstep {

namespace {

constexpr int most_parts_of_a_step = 40, most_tries = 60, most_halvings = 20;
constexpr double finest_part = 1e-14;  // of the step

}  // namespace

KinkSteps::KinkSteps(Integrator& integrator) : integrator_(integrator), kinks_(integrator.scene().kinks) {
  if (kinks_ && kinks_->count() == 0) kinks_ = nullptr;
}

/// By the velocity of the projected momentum: where rows act, the estimate of a step is not that of the
/// method's order.
void KinkSteps::read(Vector& switches) {
  const bool known = integrator_.sample(Momentum::projected, here_).ok();
  switches.resize(kinks_->count());
  kinks_->evaluate(integrator_.time(), integrator_.position(),
                   known ? here_.v : integrator_.velocity_estimate(), switches);
}

/// The number of a kink that the step crossed; -1 where none.
int KinkSteps::first_change() const {
  for (Eigen::Index k = 0; k < after_.size(); ++k)
    if (kinks_->kinds()[static_cast<std::size_t>(k)] == Kinks::Kind::kink && before_[k] * after_[k] < 0.0)
      return static_cast<int>(k);
  return -1;
}

/// The number of a kink that the motion is about to cross or comes from; -1 where none.
int KinkSteps::ahead() const {
  if (changes_.size() != before_.size()) return -1;
  for (Eigen::Index k = 0; k < before_.size(); ++k)
    if (kinks_->kinds()[static_cast<std::size_t>(k)] == Kinks::Kind::kink &&
        std::abs(before_[k]) <= 2.0 * changes_[k])
      return static_cast<int>(k);
  return -1;
}

/// Takes the last step again so that it ends behind the zero of one function.
StepReport KinkSteps::shorten(int number, double& size) {
  double low = 0.0, high = size, at_low = before_[number], at_high = after_[number];
  const double finest = std::max(finest_part * std::abs(size),
                                 4.0 * std::numeric_limits<double>::epsilon() * std::abs(integrator_.time()));
  StepReport report;
  for (int k = 0; k < most_tries && std::abs(high - low) > finest; ++k) {
    double next = k % 3 == 2 ? 0.5 * (low + high) : low - at_low * (high - low) / (at_high - at_low);
    const double margin = std::min(0.5 * finest, 0.25 * std::abs(high - low));  // so that both ends close in
    next = std::clamp(next, std::min(low, high) + margin, std::max(low, high) - margin);
    report = integrator_.retry(next);
    if (!report.ok()) return report;
    size = next;
    read(after_);
    if (before_[number] * after_[number] < 0.0) {
      high = next;
      at_high = after_[number];
    } else {
      low = next;
      at_low = after_[number];
    }
  }
  if (size == high) return report;
  report = integrator_.retry(high);
  size = high;
  if (report.ok()) read(after_);
  return report;
}

StepReport KinkSteps::stuck(int number) const {
  StepReport report;
  report.solve.status = SolveStatus::no_convergence;
  report.time = integrator_.time();
  report.failure =
      "from t = " + to_text(integrator_.time(), 6) + " the motion crosses " +
      kinks_->names()[static_cast<std::size_t>(number)] +
      " again and again: the force there points back from both sides, as that of dry friction at rest, and "
      "lets no step pass; write one that is steep instead of a jump, as tanh(v/eps)";
  return report;
}

StepReport KinkSteps::step(double h, const std::function<bool()>& at_part) {
  if (!kinks_) return integrator_.step(h);
  const double start = integrator_.time();
  double left = h;
  int crossed = -1;  // the last
  for (int part = 0; part < most_parts_of_a_step; ++part) {
    read(before_);
    double size = left;
    StepReport report = integrator_.step(size);
    const auto refused = [&report] { return report.solve.status == SolveStatus::refused; };
    for (int k = 0; k < most_halvings && !report.ok() && !refused(); ++k)
      report = integrator_.step(size *= 0.5);
    if (refused()) return report;
    if (!report.ok()) {
      const int number = crossed >= 0 ? crossed : ahead();
      return number >= 0 ? stuck(number) : report;
    }
    read(after_);
    changes_ = (after_ - before_).cwiseAbs();
    int number = first_change(), last = -1;
    // Each function once: several vanish together, as those of v > 0 and v < 0.
    for (int k = 0; k < kinks_->count() && number >= 0 && std::abs(size) > finest_part * std::abs(h); ++k) {
      last = number;
      report = shorten(number, size);
      if (!report.ok()) return report;
      Vector& now = after_;
      now[number] = before_[number];  // crossed at the end; what else changed before it?
      number = first_change();
    }
    if (last >= 0) crossed = last;
    left = start + h - integrator_.time();
    if (std::abs(left) <= finest_part * std::abs(h) || left * h <= 0.0) return report;
    if (!at_part()) return report;
  }
  before_ = before_.cwiseAbs();
  if (crossed < 0) before_.minCoeff(&crossed);  // steps that only come nearer and nearer
  return stuck(crossed);
}

}  // namespace diracstep
