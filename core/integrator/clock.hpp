#pragma once

namespace diracstep {

/// The time of a run: `base`, where the step size last changed, and steps of one size from there on, so that
/// equal steps add no round-off up.
struct Clock {
  double base = 0.0;
  double rest = 0.0;  ///< what rounding has dropped from the base
  long steps = 0;     ///< of the usual size since then

  double time(double usual) const { return base + static_cast<double>(steps) * usual; }

  void advance(double h, double usual) {
    if (h == usual) {
      ++steps;
      return;
    }
    const double now = time(usual), change = h + rest, next = now + change;
    *this = {next, change - (next - now), 0};
  }
};

}  // namespace diracstep
