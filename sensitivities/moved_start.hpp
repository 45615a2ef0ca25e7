#pragma once

#include <diracstep/core/system/consistent_start.hpp>
#include <diracstep/core/system/scene.hpp>

namespace diracstep {

/// Derivatives of a start that was moved onto the rows (project_start()) by the parameters θ, the last
/// coordinates of `extended` (ParametricScene): dq and dv are those of the start as stated and become those
/// of where it was moved to.  Components that are no guesses keep theirs; those of `guesses` follow the rows,
/// as the nearest point does: with q̂, v̂ stated, for guessed components
///
///   q − q̂ + A_hᵀν = 0,   φ = 0;        ∂L/∂v(q,v) − Aᵀμ = ∂L/∂v(q,v̂),   A v + b = 0
///
/// An empty list stands for all, as there; `guesses` of the velocity alone leave q where it was stated.
void move_start_derivatives(const std::shared_ptr<const Scene>& extended, const Vector& parameters,
                            const Start& stated, const Start& moved, const Guesses& guesses, Columns& dq,
                            Columns& dv);

}  // namespace diracstep
