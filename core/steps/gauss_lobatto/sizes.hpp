#pragma once

#include <algorithm>
#include <diracstep/core/steps/state.hpp>

namespace diracstep {

/// Sizes of the terms in the rows of the momentum of a step GL(s), by which its round-off is judged: those of
/// the step before, until its own are known.
struct StageSizes {
  explicit StageSizes(int dimension) : momenta(Vector::Zero(dimension)), forces(momenta) {}

  /// Numbers in StepMemory::scales.
  static int stored(int dimension) { return 3 + 2 * dimension; }

  bool known = false;          ///< from a step before
  double position = 0.0;       ///< of q0
  double force = 0.0;          ///< of ∂L/∂q
  double curvature = 0.0;      ///< of ∂²L/∂q²
  double row_curvature = 0.0;  ///< of ∂(Aᵀλ)/∂q
  Vector momenta;              ///< of the terms of ∂L/∂v, coordinate by coordinate
  Vector forces;               ///< of those of ∂L/∂q + f

  void begin(const StepMemory& memory, double size_of_q0) {
    known = memory.known;
    position = size_of_q0;
    force = known ? memory.scales[0] : 0.0;
    curvature = known ? memory.scales[1] : 0.0;
    row_curvature = known ? memory.scales[2] : 0.0;
    const Eigen::Index n = momenta.size();
    const double* const by_row = memory.scales.data() + 3;
    for (Eigen::Index i = 0; i < n; ++i) momenta[i] = known ? by_row[i] : 0.0;
    for (Eigen::Index i = 0; i < n; ++i) forces[i] = known ? by_row[n + i] : 0.0;
  }

  void store(StepMemory& memory) const {
    memory.known = true;
    const Eigen::Index n = momenta.size();
    memory.scales.resize(3 + 2 * n);
    double* const scales = memory.scales.data();
    scales[0] = force;
    scales[1] = curvature;
    scales[2] = row_curvature;
    std::copy_n(momenta.data(), n, scales + 3);
    std::copy_n(forces.data(), n, scales + 3 + n);
  }

  /// Of momenta, of what they lose to the round-off of positions, and of forces over |h|.
  double momentum(double h, double size_of_p0) const {
    return size_of_p0 + h * force + h * curvature * position;
  }
};

}  // namespace diracstep
