#pragma once

#include <diracstep/core/dirac/generating_function.hpp>
#include <memory>

namespace diracstep {

/// Discrete generalised Legendre transform of a discrete Lagrangian to type 2, 3 or 4.  The end points that
/// the new arguments replace become inner columns at which the new function is stationary, so nothing is
/// inverted:
///
///   two    H_{d+}(q0,p1) = stat_{q1}     p1·q1 − L_d(q0,q1)                Leok and Ohsawa (9.6)
///   three  H_{d−}(p0,q1) = stat_{q0}    −p0·q0 − L_d(q0,q1)                Leok and Ohsawa (9.7)
///   four   S(p0,p1)      = stat_{q0,q1}  p0·q0 − p1·q1 + L_d(q0,q1)        beyond the paper
///
/// Throws Misuse unless `lagrangian` is of type 1 and `type` is not.
std::unique_ptr<GeneratingFunction> legendre(GeneratingType type,
                                             std::unique_ptr<GeneratingFunction> lagrangian);

}  // namespace diracstep
