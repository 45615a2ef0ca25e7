#pragma once

#include <diracstep/core/system/scene.hpp>

namespace diracstep {

/// The rows that a degenerate Lagrangian hides.
///
/// Where ∂²L/∂v² is singular on Δ_Q, the columns of W span ker A ∩ ker ∂²L/∂v²: motions that the rows allow
/// and that carry no momentum, such as charge going round a loop of a circuit without inductors.  Since W is
/// constant, Wᵀ(d/dt ∂L/∂v) vanishes and
///
///   Wᵀ(∂L/∂q + f) = 0
///
/// (Kirchhoff's voltage law around the loops) holds along every motion.  Of these rows those in which f
/// resists a motion along W (R v) are rows on velocities,  W_rᵀ(∂f/∂v v + ∂L/∂q + f(t,q,0)) = 0;  the others
/// are rows on positions, φ(t,q) = W_cᵀ(∂L/∂q + f) = 0, in which f must not depend on the velocities that the
/// scene's rows allow.  Where f resists by more than R v, no rows on velocities are added: the equations
/// along W determine them as they are (FirstOrderMotions::by_force).  Beside these rows they make the
/// saddle-point matrix of saddle_point.hpp regular: they fix the velocities that momenta leave open, and
/// their own multipliers are zero along the motion, since A_hidden W is regular and Wᵀ(∂L/∂q + f) = 0.
///
/// Where a position along W enters as a factor only, as a multiplier does, the row on positions is one of the
/// scene with a force, which is that coordinate: multiplier_rows.hpp.
///
/// Second derivatives of the position rows hold third derivatives of L and are left out: they are zero for
/// linear capacitors, and elsewhere change nothing but the acceleration along W.
///
/// Empty where ∂²L/∂v² is regular on Δ_Q at the start or near it, for motions of first order
/// (first_order_motions.hpp) and where what is hidden holds velocities or W moves (kernel_motions.hpp), which
/// have steps of their own, and for scenes given by a Hamiltonian alone, which hide nothing.  Throws Misuse
/// where such a motion is determined by nothing, or by more than is described here, and names it.
ConstraintBlocks hidden_rows(const Scene& scene);

/// The scene itself where it hides no rows; else a copy with them below its own, and with the velocities that
/// carry no momentum at the start set by them.  They are no data of a motion: no motion but that one starts
/// at this q and p.
std::shared_ptr<const Scene> with_hidden_rows(std::shared_ptr<const Scene> scene);

}  // namespace diracstep
