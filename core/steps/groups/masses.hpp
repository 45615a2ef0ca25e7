#pragma once

#include <diracstep/core/system/scene.hpp>

namespace diracstep {

/// Throws Misuse where ∂²L/∂ξ² at the start is singular along velocities that the rows allow, naming one:
/// what a step on a group has no equation for.  In R^n such motions of first order have steps of their own.
void require_masses(const Scene& scene);

}  // namespace diracstep
