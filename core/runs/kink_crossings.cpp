#include <algorithm>
#include <cmath>
#include <diracstep/core/runs/kink_crossings.hpp>
#include <diracstep/core/system/sign_changes.hpp>

namespace diracstep {

KinkCrossings::KinkCrossings(std::shared_ptr<const Kinks> kinks, double first, double last)
    : kinks_(std::move(kinks)) {
  if (!kinks_) return;
  values_.setZero(kinks_->count());
  for (const auto& [time, width] : kinks_->instants(std::min(first, last), std::max(first, last)))
    for (const double off : {0.0, -6.0, 6.0, -1.0, 1.0})
      if (off == 0.0 || width > 0.0)
        instants_.push_back({time + off * width, off == 0.0 ? 0.0 : width, width > 0.0});
  std::ranges::sort(instants_, {}, &Cut::time);
}

bool KinkCrossings::instant_between(double a, double b) const {
  const auto next = std::ranges::upper_bound(instants_, std::min(a, b), {}, &Cut::time);
  return next != instants_.end() && next->time < std::max(a, b);
}

void KinkCrossings::add_switches(const PathCubic& path, double a, double b, int looks, double precision,
                                 std::vector<KinkCrossing>& found) {
  const auto evaluate = [&](double t, Vector& values) {
    path.at(t, q_, v_);
    kinks_->evaluate(t, q_, v_, values);
  };
  const auto narrow = [&](Eigen::Index r, double from, double to) {
    evaluate(from, values_);
    const int sign = sign_of(values_[r]);
    while (std::abs(to - from) > precision) {
      const double t = 0.5 * (from + to);
      if (t == from || t == to) break;
      evaluate(t, values_);
      (sign_of(values_[r]) == sign ? from : to) = t;
    }
    found.push_back({to, static_cast<int>(r), false, false});
  };
  SignChanges(kinks_->count(), evaluate, narrow).look(a, b, looks, true);
}

std::vector<KinkCrossing> KinkCrossings::along(const PathCubic& path, double a, double b, int looks,
                                               double precision) {
  std::vector<KinkCrossing> found;
  if (!kinks_) return found;
  if (kinks_->count() > 0) add_switches(path, a, b, looks, precision, found);
  const double low = std::min(a, b), high = std::max(a, b);
  for (auto cut = std::ranges::upper_bound(instants_, low, {}, &Cut::time);
       cut != instants_.end() && cut->time < high; ++cut)
    if (cut->width == 0.0 || cut->width < high - low) found.push_back({cut->time, -1, true, cut->smooth});
  std::erase_if(found, [&](const KinkCrossing& it) { return !(it.time > low && it.time < high); });
  const double sign = b < a ? -1.0 : 1.0;
  std::ranges::stable_sort(found, {}, [sign](const KinkCrossing& it) { return sign * it.time; });
  std::vector<KinkCrossing> once;
  for (const KinkCrossing& it : found) {
    if (once.empty() || std::abs(it.time - once.back().time) > 4.0 * precision) {
      once.push_back(it);
      continue;
    }
    once.back().number = std::max(once.back().number, it.number);
    once.back().instant = once.back().instant || it.instant;
    once.back().smooth = once.back().smooth && it.smooth;
  }
  return once;
}

}  // namespace diracstep
