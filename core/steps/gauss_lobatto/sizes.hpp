#pragma once

#include <algorithm>
#include <cmath>
#include <diracstep/core/steps/state.hpp>

namespace diracstep {

/// Sizes of the terms in the rows of the momentum of a step GL(s), by which its round-off is judged: those of
/// the step before, until its own are known.
struct StageSizes {
  static constexpr int stored = 3;  ///< numbers in StepMemory::scales

  bool known = false;          ///< from a step before
  double position = 0.0;       ///< of q0
  double force = 0.0;          ///< of ∂L/∂q
  double curvature = 0.0;      ///< of ∂²L/∂q²
  double row_curvature = 0.0;  ///< of ∂(Aᵀλ)/∂q

  void begin(const StepMemory& memory, double size_of_q0) {
    known = memory.known;
    position = size_of_q0;
    force = known ? memory.scales[0] : 0.0;
    curvature = known ? memory.scales[1] : 0.0;
    row_curvature = known ? memory.scales[2] : 0.0;
  }

  void store(StepMemory& memory) const {
    memory.known = true;
    memory.scales.resize(stored);
    double* const scales = memory.scales.data();
    scales[0] = force;
    scales[1] = curvature;
    scales[2] = row_curvature;
  }

  /// Of momenta, of what they lose to the round-off of positions, and of forces over |h|.
  double momentum(double h, double size_of_p0) const {
    return size_of_p0 + h * force + h * curvature * position;
  }
};

/// The size that velocities in rows are measured by: that which the terms of momenta would give the largest
/// mass, where that is more, since at rest under forces that rows take up all velocities are round-off of it.
inline double speed_at_rest(double speed, double terms, double mass) {
  return std::max(speed, mass > 0.0 && std::isfinite(terms) ? terms / mass : 0.0);
}

}  // namespace diracstep
