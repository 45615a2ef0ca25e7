#pragma once

#include <diracstep/core/dirac/generating_function.hpp>
#include <diracstep/core/system/phase_function.hpp>
#include <memory>

namespace diracstep {

/// The discrete right Hamiltonian of symplectic Euler, type 2, order 1:
///
///   H_{d+}(q0,p1) = p1·q0 + h H(t0, q0, p1)
std::unique_ptr<GeneratingFunction> euler_type2(std::shared_ptr<const Hamiltonian> hamiltonian);

/// The discrete left Hamiltonian of the adjoint symplectic Euler, type 3, order 1:
///
///   H_{d−}(p0,q1) = −p0·q1 + h H(t1, q1, p0)
std::unique_ptr<GeneratingFunction> euler_type3(std::shared_ptr<const Hamiltonian> hamiltonian);

}  // namespace diracstep
