#pragma once

#include <diracstep/core/system/phase_function.hpp>
#include <memory>

namespace diracstep {

/// H(t,q,p) = p·v − L(t,q,v) at p = ∂L/∂v, and L(t,q,v) = p·v − H(t,q,p) at v = ∂H/∂p: the regular case.
///
/// Each evaluation finds the conjugate column by Newton's method from the last one, to round-off; where that
/// fails every result is NaN, which solvers report.  The derivatives are exact.  Throws Misuse where the
/// Hessian in the second argument is singular at (t, q, y): the function is degenerate there and has no such
/// transform.
std::shared_ptr<const Hamiltonian> hamiltonian_from(std::shared_ptr<const Lagrangian> lagrangian, double t,
                                                    ConstVectorRef q, ConstVectorRef v);
std::shared_ptr<const Lagrangian> lagrangian_from(std::shared_ptr<const Hamiltonian> hamiltonian, double t,
                                                  ConstVectorRef q, ConstVectorRef p);

/// A basis of ker ∂²H/∂p² at a point, each direction scaled to a largest entry of 1; without a column where
/// that is regular, and where it is not finite.
Columns directions_linear_in_p(const Hamiltonian& hamiltonian, double t, ConstVectorRef q, ConstVectorRef p);

}  // namespace diracstep
