#pragma once

#include <diracstep/core/dirac/generating_function.hpp>
#include <diracstep/core/dirac/step_rule.hpp>
#include <diracstep/core/system/phase_function.hpp>
#include <memory>
#include <vector>

namespace diracstep {

/// The discrete Lagrangian on straight segments, type 1:
///
///   L_d(q0,q1) = h Σ w_i L(t0 + c_i h, (1−c_i) q0 + c_i q1, (q1−q0)/h)
///
/// with the nodes of `rule`: left and right rectangle (order 1), midpoint and trapezoidal (order 2).
std::unique_ptr<GeneratingFunction> quadrature_lagrangian(std::shared_ptr<const Lagrangian> lagrangian,
                                                          StepRule rule);

}  // namespace diracstep
