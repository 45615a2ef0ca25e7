#pragma once

#include <diracstep/core/spaces/space.hpp>
#include <diracstep/core/system/constraint_rows.hpp>
#include <diracstep/core/system/force.hpp>
#include <diracstep/core/system/phase_function.hpp>
#include <memory>

namespace diracstep {

/// Functions of stored numbers as functions on a configuration space, with left-trivialised derivatives:
/// increments multiply from the right, velocities and momenta are in the body.
///
/// What is given is written as in R^N with N = Space::storage_size(): q are the stored numbers, the first
/// Space::dimension() entries of v or of a row are those of a velocity, and the others are not to be used.
///
///   const auto so3 = space(spaces::SO3{});
///   scene.lagrangian = on_space(so3, lagrangian<4>([](const auto& q, const auto& w) {
///     const auto R = spaces::rotation_matrix(q[0], q[1], q[2], q[3]);
///     return 0.5 * (w[0]*w[0] + 2.0*w[1]*w[1] + 3.0*w[2]*w[2]) - 9.81 * R[2][2]; }));
///
/// With B = d(q τ(x))/dx at x = 0 the derivatives are Bᵀ ∂f/∂q and so on.  Holonomic rows φ(q) = 0 have A =
/// ∂φ/∂q B; nonholonomic ones and forces are components along the velocities as they stand.  Throw Misuse
/// where sizes differ.
std::shared_ptr<const Lagrangian> on_space(std::shared_ptr<const Space> space,
                                           std::shared_ptr<const Lagrangian> of_numbers);
std::shared_ptr<const ConstraintRows> on_space(std::shared_ptr<const Space> space,
                                               std::shared_ptr<const ConstraintRows> of_numbers);
std::shared_ptr<const Force> on_space(std::shared_ptr<const Space> space,
                                      std::shared_ptr<const Force> of_numbers);

}  // namespace diracstep
