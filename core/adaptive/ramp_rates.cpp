#include <algorithm>
#include <cmath>
#include <diracstep/core/adaptive/ramp_rates.hpp>

namespace diracstep {

namespace {

constexpr std::ptrdiff_t instants_beside = 2;  // on each side of a time: those further away count for little

}  // namespace

RampRates::RampRates(const Scene& scene, double first, double last) : kinks_(scene.kinks) {
  if (!kinks_) return;
  if (std::ranges::count(kinks_->kinds(), Kinks::Kind::ramp) > 0) count_ = kinks_->count();
  if (!std::isfinite(first) || !std::isfinite(last)) return;
  instants_ = kinks_->instants(std::min(first, last), std::max(first, last));
  std::erase_if(instants_, [](const Kinks::Instant& instant) { return !(instant.width > 0.0); });
}

void RampRates::evaluate(double t, ConstVectorRef q, ConstVectorRef v, VectorRef g) const {
  kinks_->evaluate(t, q, v, g);
}

double RampRates::squared(double t, ConstVectorRef before, ConstVectorRef here, ConstVectorRef after,
                          double delta) const {
  double sum = 0.0;
  for (Eigen::Index k = 0; k < count_; ++k) {
    if (kinks_->kinds()[static_cast<std::size_t>(k)] != Kinks::Kind::ramp) continue;
    const double rate = (after[k] - before[k]) / (2.0 * delta),
                 part = rate * rate / (1.0 + here[k] * here[k]);
    if (std::isfinite(part)) sum += part;
  }
  const auto next = std::ranges::lower_bound(instants_, t, {}, &Kinks::Instant::time);
  const auto first = next - std::min(instants_beside, next - instants_.begin()),
             last = next + std::min(instants_beside, instants_.end() - next);
  for (auto it = first; it != last; ++it) {
    const double away = t - it->time;
    sum += 1.0 / (it->width * it->width + away * away);
  }
  return sum;
}

}  // namespace diracstep
