#pragma once

#include <diracstep/core/system/scene.hpp>
#include <vector>

namespace diracstep {

/// A steady state at the time of the start in which some coordinates rest, such as the charges of capacitors,
/// and all others move on at constant velocities, such as the charges through resistors and inductors,
///
///   ∂L/∂q + f − (∂²L/∂v∂q) v − ∂²L/∂v∂t + A(q)ᵀλ = 0,   A(q) v + b(t,q) = 0,   v_i = 0 of those at rest.
///
/// Unknown are the positions of those at rest, the velocities of the others, whose positions stay those of
/// the start, and λ.  For circuits these are the equations of an operating point: no current through
/// capacitors, no voltage across inductors.
///
/// What they leave open stays as it is at the start: yᵀA q where no velocity of a moving coordinate enters
/// (yᵀA v), as the charge of a node that only capacitors join, and zᵀ∂L/∂v where A z = 0 and (∂f/∂v) z = 0,
/// as the flux through a loop of inductors.
///
/// Newton's method with full matrices, damped by the natural monotonicity test (Deuflhard, Newton Methods for
/// Nonlinear Problems, 2004, 3.3), which does not depend on the units of equations.  Throws Misuse for more
/// than 2000 unknowns, where none is found, and where the equations contradict each other, such as those of a
/// voltage across inductors alone, with the equation that is left.
Start operating_point(const Scene& scene, const Start& start, const std::vector<bool>& resting);

/// Derivatives of that start by parameters θ, which are the last coordinates of `extended`: dq and dv are
/// those of the start that it was looked for from, and become those of `found`.  `resting` is as above.
void operating_point_derivatives(const Scene& extended, const Vector& parameters, const Start& found,
                                 const std::vector<bool>& resting, Columns& dq, Columns& dv);

}  // namespace diracstep
