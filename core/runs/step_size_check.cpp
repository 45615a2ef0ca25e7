#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/runs/step_size_check.hpp>
#include <numeric>
#include <sstream>

namespace diracstep {

namespace {

constexpr long steps_for_a_look = 600, fewest_looks = 3;
constexpr double shortest_part = 1e-6;     // of a step, behind a kink
constexpr double doubted_at_kinks = 2e-4;  // of the motion

/// So many steps of one size over the time of `taken` that no node but the ends is one of theirs: a contact
/// about a node that both share would be cut into the same parts.
long finer(long taken) {
  long count = std::lround(static_cast<double>(taken) / (1.0 - StepComparison::first_part));
  while (std::gcd(count, taken) > 1) ++count;
  return count;
}

}  // namespace

StepSizeCheck::StepSizeCheck(const Integrator& integrator, long steps, bool repeats)
    : comparison_(integrator.scene(), integrator.method().order),
      between_looks_(std::clamp(steps / fewest_looks, 1L, steps_for_a_look)),
      next_look_(integrator.work().steps + std::min(1L, steps - 1)),
      velocity_(integrator.velocity_estimate()),
      order_(std::max(integrator.method().order, integrator.options().order)),
      repeats_(repeats && integrator.scene().kinks && steps <= StepComparison::most_repeated &&
               integrator.scene().dimension() + integrator.scene().rows() <=
                   StepComparison::most_unknowns_repeated),
      wanted_(steps),
      taken_before_(integrator.work().steps) {}

void StepSizeCheck::divide(Integrator& integrator) {
  const Snapshot state = integrator.save();
  const double h = integrator.options().step, first = StepComparison::first_part * h;
  divided_ = integrator.sample(Momentum::projected, start_).ok() && integrator.step(first).ok() &&
             integrator.step(h - first).ok() && integrator.sample(Momentum::projected, parts_).ok();
  integrator.restore(state);
}

void StepSizeCheck::compare(Integrator& integrator) {
  divided_ = false;
  if (!integrator.sample(Momentum::projected, whole_).ok()) return;
  comparison_.add(start_, integrator.options().step, whole_, parts_, place_);
}

void StepSizeCheck::keep_kinks(Integrator& integrator) {
  if (++over_kinks_ < next_over_kinks_) return;
  next_over_kinks_ = over_kinks_ < fewest_looks ? over_kinks_ + 1 : 2 * over_kinks_;
  if (!integrator.sample(Momentum::projected, end_).ok()) return;
  kinks_.assign(integrator.kinks_passed().begin(), integrator.kinks_passed().end());
}

/// Between the kinks of the last step, and from the last of them to its end.
void StepSizeCheck::look_behind_kinks(Integrator& integrator) {
  const Snapshot state = integrator.save();
  for (std::size_t k = 0; k < kinks_.size(); ++k) {
    const bool last = k + 1 == kinks_.size();
    const double size = (last ? end_.time : kinks_[k + 1].time) - kinks_[k].time,
                 first = StepComparison::first_part * size;
    if (!(std::abs(size) > shortest_part * std::abs(integrator.options().step)) ||
        !integrator.sample(kinks_[k], Momentum::projected, start_).ok())
      continue;
    if (last)
      whole_ = end_;
    else if (!integrator.sample(kinks_[k + 1], Momentum::projected, whole_).ok())
      continue;
    integrator.restart(kinks_[k].time, kinks_[k].at.q, kinks_[k].at.p, start_.v);
    if (integrator.step(first).ok() && integrator.step(size - first).ok() &&
        integrator.sample(Momentum::projected, parts_).ok())
      comparison_.add(start_, size, whole_, parts_, StepComparison::Place::at_kink);
  }
  ++looks_at_kinks_;
  kinks_.clear();
  integrator.restore(state);
}

void StepSizeCheck::see(const Sample& point) {
  if (!repeats_) return;
  if (first_.size() == 0) first_ = point.q;
  way_ = std::max(way_, max_norm(point.q - first_));
  largest_momentum_ = std::max(largest_momentum_, max_norm(point.p));
}

/// The run once more, with finer steps.
void StepSizeCheck::repeat(Integrator& integrator) {
  if (taken_ == 0 || taken_ != wanted_ || integrator.work().steps - taken_before_ != taken_ ||
      !(way_ > 0.0) || !(largest_momentum_ > 0.0) || comparison_.at_rest_throughout() ||
      !integrator.sample(Momentum::projected, whole_).ok())
    return;
  const Snapshot end = integrator.save();
  const long count = finer(taken_);
  const double part = static_cast<double>(taken_) / static_cast<double>(count);
  integrator.restore(start_of_run_);
  bool ok = true;
  for (long k = 0; k < count && ok; ++k) ok = integrator.step(part * integrator.options().step).ok();
  constexpr double same_time = 1e-9;  // in steps; else those of the run were of several sizes
  if (ok && integrator.sample(Momentum::projected, parts_).ok() &&
      std::abs(parts_.time - whole_.time) <= same_time * std::abs(integrator.options().step))
    error_ = unresolved_ + 1.0 / (1.0 - std::pow(part, order_)) *
                               std::max(max_norm(whole_.q - parts_.q) / way_,
                                        max_norm(whole_.p - parts_.p) / largest_momentum_);
  integrator.restore(end);
}

std::string StepSizeCheck::text() const {
  if (std::string text = comparison_.text(); !text.empty()) return text;
  if (error_ > StepComparison::largest_error(order_)) {
    std::ostringstream text;
    text.precision(2);
    text
        << "step size check: the run crosses kinks of the force, and with finer steps it ends elsewhere: its "
           "error is "
        << std::min(100.0, 100.0 * error_)
        << " % of the motion; take shorter steps, or ask for an error, --error";
    return text.str();
  }
  if (confirmed() || looks_at_kinks_ == 0) return {};
  const double part = comparison_.sum_at_kinks() / static_cast<double>(looks_at_kinks_);
  const double all = part * static_cast<double>(over_kinks_);
  if (!(all > doubted_at_kinks)) return {};
  std::ostringstream text;
  text.precision(2);
  text << "step size check: at kinks of the force two substeps and the whole step differ by "
       << std::min(1.0, part) << " of the motion, far more than elsewhere, and " << over_kinks_
       << " steps cross some: what acts behind them, as a contact, is too short for the steps; take shorter "
          "ones, or ask for an error, --error";
  return text.str();
}

}  // namespace diracstep
