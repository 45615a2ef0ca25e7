#pragma once

#include <cmath>
#include <diracstep/core/numerics/types.hpp>
#include <vector>

namespace diracstep {

inline int sign_of(double x) { return x > 0.0 ? 1 : x < 0.0 ? -1 : 0; }

/// Looks for changes of the sign of functions g_r(t) within (first, last), which may run backwards, from
/// values at `looks` + 1 even times.
///
/// Two zeros between neighbouring times show in no sign there.  So where |g_r| is smallest at a time and may
/// vanish beside it, as far as the differences to its neighbours tell, the smallest value is searched for: a
/// pulse whose g rises or falls towards it over more than a look, such as 1 − |t − c|/w or 1 − ((x − c)/w)²,
/// is found however narrow it is.  One whose g is flat beside it is not.
///
/// `evaluate(t, g)` writes the values; it is also asked at one look beyond either end where `beyond`.
/// `found(r, a, b)` is called for each change, a before b.
template <class Evaluate, class Found>
class SignChanges {
 public:
  SignChanges(Eigen::Index count, Evaluate evaluate, Found found)
      : evaluate_(std::move(evaluate)),
        found_(std::move(found)),
        before_(count),
        here_(count),
        next_(count),
        probe_(count) {}

  void look(double first, double last, long looks, bool beyond) {
    const double d = (last - first) / static_cast<double>(looks);
    const auto at = [&](long k) {
      return k == looks ? last : k == 0 ? first : first + static_cast<double>(k) * d;
    };
    evaluate_(at(0), here_);
    if (beyond) evaluate_(at(-1), before_);
    for (long k = 0; k <= looks; ++k) {
      const bool last_look = k == looks;
      if (!last_look || beyond) evaluate_(last_look ? last + d : at(k + 1), next_);
      for (Eigen::Index r = 0; r < here_.size(); ++r) {
        if (!last_look && sign_of(here_[r]) != sign_of(next_[r])) found_(r, at(k), at(k + 1));
        if ((k == 0 || last_look) && !beyond) continue;
        if (may_vanish(r)) search(r, at(k) - d, at(k) + d, first, last);
      }
      std::swap(before_, here_);
      std::swap(here_, next_);
    }
  }

 private:
  bool may_vanish(Eigen::Index r) const {
    const int sign = sign_of(here_[r]);
    if (sign == 0 || sign_of(before_[r]) != sign || sign_of(next_[r]) != sign) return false;
    const double left = std::abs(before_[r]) - std::abs(here_[r]),
                 right = std::abs(next_[r]) - std::abs(here_[r]);
    return left >= 0.0 && right >= 0.0 && std::abs(here_[r]) <= 2.0 * std::max(left, right);
  }

  /// The smallest |g_r| in (a, b) by golden sections, until its sign has changed.
  void search(Eigen::Index r, double a, double b, double first, double last) {
    constexpr int sections = 60;
    const double golden = 0.6180339887498949;
    const int sign = sign_of(here_[r]);
    const double from = a, to = b;
    const auto size = [&](double t) {
      evaluate_(t, probe_);
      return sign * probe_[r];
    };
    double c = b - golden * (b - a), d = a + golden * (b - a), at_c = size(c), at_d = size(d);
    for (int k = 0; k < sections && a != b; ++k) {
      if (at_c < 0.0 || at_d < 0.0) {
        const double turned = at_c < 0.0 ? c : d;
        report(r, from, turned, first, last);
        return report(r, turned, to, first, last);
      }
      if (at_c < at_d) {
        b = d;
        d = c;
        at_d = at_c;
        at_c = size(c = b - golden * (b - a));
      } else {
        a = c;
        c = d;
        at_c = at_d;
        at_d = size(d = a + golden * (b - a));
      }
    }
  }

  /// A change between a and b, where it lies within the limits.
  void report(Eigen::Index r, double a, double b, double first, double last) {
    const auto inside = [&](double t) { return (t - first) * (last - t) >= 0.0; };
    if (inside(a) && inside(b)) return found_(r, a, b);
    const double limit = (a - first) * (last - first) < 0.0 ? first : last;
    const double other = limit == first ? b : a;
    if (!inside(other)) return;
    evaluate_(limit, probe_);
    const int at_limit = sign_of(probe_[r]);
    evaluate_(other, probe_);
    if (sign_of(probe_[r]) == at_limit) return;
    limit == first ? found_(r, limit, other) : found_(r, other, limit);
  }

  Evaluate evaluate_;
  Found found_;
  Vector before_, here_, next_, probe_;
};

}  // namespace diracstep
